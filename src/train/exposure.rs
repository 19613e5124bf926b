//! The exposures of the training photos: an affine colour map for each, estimated once an epoch by least squares
//! towards the identity from the sums of the epoch's steps (method 3.1). The mean over the views stays the identity,
//! so that the scene keeps the mean exposure.

use crate::backend::{ColourMap, ColourSums};
use glam::{DMat4, DVec4};

/// Photos are corrected if a mid-grey varies over the views by more than this (root mean square). Below it, what is
/// estimated is the error of the scene: photos without drift gave 0.010, with half a stop 0.048, a phone's 0.05
/// (measured: `samples/stress.toml`, control and exposure; fox).
const DRIFT_MIN: f64 = 0.02;

/// Weight of the identity, in units of the sum over the pixels: a variance of colours.
const RIDGE: f64 = 1e-3;

/// Exposures of all views, and the sums of the current epoch. Both empty without correction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exposures {
    /// By view. `[views]`
    pub maps: Vec<ColourMap>,
    /// By view; zeros if the epoch has not come to the view. `[views]`
    pub sums: Vec<ColourSums>,
}

impl Exposures {
    /// Identity for every view.
    pub fn new(num_views: usize) -> Self {
        Self { maps: vec![ColourMap::IDENTITY; num_views], sums: vec![ColourSums::default(); num_views] }
    }

    /// The exposure of a view's photo; `None` without correction.
    pub fn of(&self, view: usize) -> Option<ColourMap> {
        self.maps.get(view).copied()
    }

    /// Notes what a step on a view showed.
    pub fn record(&mut self, view: usize, sums: Option<ColourSums>) {
        if let (Some(slot), Some(sums)) = (self.sums.get_mut(view), sums) {
            *slot = sums;
        }
    }

    /// Ends an epoch: with `estimate`, new maps for the views that it saw, or the identity for all if their exposures
    /// hardly differ. Forgets the sums.
    pub fn end_epoch(&mut self, estimate: bool) {
        if estimate {
            let seen: Vec<usize> = (0..self.sums.len()).filter(|&view| self.sums[view].0[0] > 0.0).collect();
            let fitted: Vec<DMat4> = seen.iter().map(|&view| fit(&self.sums[view])).collect();
            let mean =
                fitted.iter().fold(DMat4::ZERO, |sum, map| sum + *map) * (1.0 / seen.len().max(1) as f64);
            let from_mean = if mean.determinant().abs() > 1e-6 { mean.inverse() } else { DMat4::IDENTITY };
            let fitted: Vec<DMat4> = fitted.into_iter().map(|map| map * from_mean).collect();
            if drift(&fitted) < DRIFT_MIN {
                self.maps.fill(ColourMap::IDENTITY);
            } else {
                for (&view, map) in seen.iter().zip(fitted) {
                    let rows = map.transpose();
                    self.maps[view] = ColourMap([0, 1, 2].map(|c| rows.col(c).as_vec4().to_array()));
                }
            }
        }
        self.sums.fill(ColourSums::default());
    }
}

/// The affine map of x to y with the least squared error plus ridge, as a matrix of `[r, g, b, 1]`.
fn fit(sums: &ColourSums) -> DMat4 {
    let s = sums.0.map(|sum| sum / sums.0[0]);
    // Of the products of [x, 1] with itself, and with y.
    let mut normal = DMat4::from_cols(
        DVec4::new(s[4], s[5], s[6], s[1]),
        DVec4::new(s[5], s[7], s[8], s[2]),
        DVec4::new(s[6], s[8], s[9], s[3]),
        DVec4::new(s[1], s[2], s[3], 1.0),
    );
    let mut rows = [0, 1, 2].map(|c| DVec4::new(s[13 + c], s[16 + c], s[19 + c], s[10 + c]));
    for k in 0..3 {
        normal.col_mut(k)[k] += RIDGE;
        rows[k][k] += RIDGE;
    }
    normal.col_mut(3)[3] += RIDGE;
    let solve = normal.inverse();
    let [r, g, b] = rows.map(|row| solve * row);
    DMat4::from_cols(r, g, b, DVec4::W).transpose()
}

/// Root mean square over maps and channels of how far they move a mid-grey.
fn drift(maps: &[DMat4]) -> f64 {
    let grey = DVec4::new(0.5, 0.5, 0.5, 1.0);
    let squares: f64 = maps.iter().map(|map| (*map * grey - grey).length_squared()).sum();
    (squares / (3 * maps.len().max(1)) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colours that span the cube.
    fn colours() -> impl Iterator<Item = [f64; 3]> {
        (0..60).map(|i| [f64::from(i % 5) / 4.0, f64::from(i % 4) / 3.0, f64::from(i % 3) / 2.0])
    }

    fn sums_of(map: &ColourMap) -> ColourSums {
        let mut sums = ColourSums::default();
        colours().for_each(|x| sums.add(x, map.apply(x.map(|v| v as f32)).map(f64::from)));
        sums
    }

    fn error(a: &ColourMap, b: &ColourMap) -> f32 {
        a.0.iter().flatten().zip(b.0.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn drifting_exposures_are_found_relative_to_their_mean() {
        let (mut brighter, mut darker) = (ColourMap::IDENTITY, ColourMap::IDENTITY);
        brighter.0 = [[1.2, 0.05, 0.0, 0.02], [0.0, 1.1, 0.0, 0.0], [0.0, 0.0, 1.3, -0.03]];
        darker.0 = [[0.8, -0.05, 0.0, -0.02], [0.0, 0.9, 0.0, 0.0], [0.0, 0.0, 0.7, 0.03]];
        let mut exposures = Exposures::new(4);
        exposures.record(0, Some(sums_of(&brighter)));
        exposures.record(2, Some(sums_of(&darker)));
        exposures.end_epoch(true);
        // The ridge draws them towards the identity; needed 5e-3.
        assert!(error(&exposures.maps[0], &brighter) < 0.01, "{:?}", exposures.maps[0]);
        assert!(error(&exposures.maps[2], &darker) < 0.01);
        assert_eq!(exposures.maps[1], ColourMap::IDENTITY, "a view that was not seen keeps its map");
        assert_eq!(exposures.sums, Exposures::new(4).sums);
    }

    #[test]
    fn photos_of_almost_the_same_exposure_are_not_corrected() {
        let end = |gain: f32| {
            let mut exposures = Exposures::new(2);
            for (view, gain) in [(0, gain), (1, 1.0 / gain)] {
                let mut map = ColourMap::IDENTITY;
                (0..3).for_each(|c| map.0[c][c] = gain);
                exposures.record(view, Some(sums_of(&map)));
            }
            exposures.end_epoch(true);
            exposures.maps
        };
        assert_eq!(end(1.03), [ColourMap::IDENTITY; 2]);
        assert_ne!(end(1.05), [ColourMap::IDENTITY; 2], "negative control");
    }

    #[test]
    fn a_common_change_belongs_to_the_scene() {
        let mut brighter = ColourMap::IDENTITY;
        brighter.0 = [[1.2, 0.0, 0.0, 0.02], [0.0, 1.1, 0.0, 0.0], [0.0, 0.0, 1.3, -0.03]];
        let mut exposures = Exposures::new(2);
        for view in 0..2 {
            exposures.record(view, Some(sums_of(&brighter)));
        }
        let unchanged = exposures.clone();
        exposures.end_epoch(true);
        assert!(exposures.maps.iter().all(|map| error(map, &ColourMap::IDENTITY) < 1e-6));
        // Before the first estimate, only the sums are forgotten.
        let mut early = unchanged.clone();
        early.end_epoch(false);
        assert_eq!(early, Exposures::new(2));
        assert_ne!(unchanged, early);
    }

    #[test]
    fn flat_photos_give_finite_maps() {
        let mut sums = ColourSums::default();
        (0..50).for_each(|_| sums.add([0.5; 3], [0.25; 3]));
        let mut exposures = Exposures::new(2);
        exposures.record(0, Some(sums));
        exposures.record(1, Some(sums_of(&ColourMap::IDENTITY)));
        exposures.end_epoch(true);
        assert!(exposures.maps.iter().flat_map(|m| m.0).flatten().all(|v| v.is_finite() && v.abs() < 3.0));
        assert!(exposures.maps[0].apply([0.5; 3])[0] < exposures.maps[1].apply([0.5; 3])[0]);
    }
}
