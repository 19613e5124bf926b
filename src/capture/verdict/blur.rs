//! Which photos are blurred: those with half the sharpness of the sharp ones among the others.

use super::sharpness::Sharpness;
use crate::capture::frame::quantile;

/// The photo that others are compared with: three of four are less sharp. Up to that share of the photos may be blurred.
const SHARP_QUANTILE: f64 = 0.75;

/// A photo with less than this share of its sharpness, typical and best, is blurred. Measured: 0.6 is the least of the photos
/// of five real captures; with a Gaussian blur of 4 pixels, 0.3 is the most, with a motion of 12 pixels 0.42.
const BLURRED_SHARE: f64 = 0.5;

/// A photo with more fine detail than this is sharp, whatever the others are. Measured: 0.79 at most with a motion of 12
/// pixels or a Gaussian blur of 4, in photos of 320 pixels; 0.33 in larger ones.
const BLURRED_MAX: f64 = 0.8;

/// A photo is blurred too if it shows less than this share of the detail that others show around the same points. Measured:
/// 0.73 is the least of the photos of four real captures; with a Gaussian blur of 2 pixels or a motion of 9, 0.61 is the most in
/// three of them.
const BLURRED_SHARE_AT_POINTS: f64 = 0.65;

/// Median typical sharpness below which a capture is blurred throughout. Measured: 0.43 at least for the photos of five real
/// captures; with a Gaussian blur of 4 pixels 0.2 at most.
const SHARPNESS_MIN: f64 = 0.25;

/// What was found out about some photos.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Blur {
    /// Which are blurred.
    pub blurred: Vec<usize>,
    /// Median of the typical sharpness.
    pub median: Option<f64>,
}

/// Compares photos, `None` for those that show too little: their sharpness, and the share of the detail of their points that
/// they show.
pub(super) fn of(photos: &[Option<Sharpness>], at_points: &[Option<f64>]) -> Blur {
    let known: Vec<Sharpness> = photos.iter().copied().flatten().collect();
    let at = |share: f64, of: fn(&Sharpness) -> f64| {
        quantile(&mut known.iter().map(of).collect::<Vec<_>>(), share)
    };
    let (Some(typical), Some(best)) = (at(SHARP_QUANTILE, |s| s.typical), at(SHARP_QUANTILE, |s| s.best))
    else {
        return Blur::default();
    };
    let is_blurred = |s: &Sharpness, at_points: Option<f64>| {
        let is_dull = s.typical < BLURRED_SHARE * typical && s.best < BLURRED_SHARE * best;
        s.typical < BLURRED_MAX && (is_dull || at_points.is_some_and(|share| share < BLURRED_SHARE_AT_POINTS))
    };
    let indexed = photos.iter().zip(at_points).enumerate();
    let blurred = indexed
        .filter(|(_, (s, at_points))| s.as_ref().is_some_and(|s| is_blurred(s, **at_points)))
        .map(|(index, _)| index)
        .collect();
    Blur { blurred, median: at(0.5, |s| s.typical) }
}

/// Whether all photos are blurred, by the median of their typical sharpness.
pub(super) fn is_everywhere(median: f64) -> bool {
    median < SHARPNESS_MIN
}
