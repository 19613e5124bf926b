//! How much the exposure of photos differs: the brightness of the same points in each of them.

use crate::capture::frame::{median, quantile};
use crate::image::TargetImage;
use glam::DVec2;

/// Values near the ends say nothing about brightness.
const USABLE: std::ops::RangeInclusive<u8> = 8..=247;

/// Fewer points that other photos show too say nothing about a photo's exposure.
const POINTS_MIN: usize = 20;

/// Of fewer photos no range is stated.
const PHOTOS_MIN: usize = 3;

/// Passes that alternate between the exposures of the photos and the brightness of the points.
const PASSES: usize = 8;

/// Brightness of a point in a photo, binary logarithm of linear light, by channel.
pub(super) struct Seen {
    pub point: u32,
    pub stops: [f64; 3],
}

/// The brightness of the points that a photo shows: indices, and places in pixels.
pub(super) fn seen(photo: &TargetImage, points: &[(u32, DVec2)]) -> Vec<Seen> {
    let look = |&(point, at): &(u32, DVec2)| Some(Seen { point, stops: stops_at(photo, at)? });
    points.iter().filter_map(look).collect()
}

/// The mean of 3 x 3 pixels around a place; `None` outside, where masked, and where too bright or dark.
fn stops_at(photo: &TargetImage, at: DVec2) -> Option<[f64; 3]> {
    let (width, height) = (photo.width_px as usize, photo.height_px as usize);
    let (x, y) = (at.x.floor(), at.y.floor());
    if !(x >= 1.0 && y >= 1.0 && x + 2.0 <= width as f64 && y + 2.0 <= height as f64) {
        return None;
    }
    let (x, y) = (x as usize, y as usize);
    let mut sums = [0.0; 3];
    for pixel in (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| y * width + x)) {
        if photo.mask.as_ref().is_some_and(|mask| mask[pixel] == 0) {
            return None;
        }
        for (sum, value) in sums.iter_mut().zip(&photo.rgb[3 * pixel..3 * pixel + 3]) {
            if !USABLE.contains(value) {
                return None;
            }
            *sum += linear(*value);
        }
    }
    Some(sums.map(|sum| (sum / 9.0).log2()))
}

/// Linear light of an sRGB value.
fn linear(value: u8) -> f64 {
    let v = f64::from(value) / 255.0;
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The range from the 10th to the 90th percentile of the photos' exposures, stops, of the channel where it is largest;
/// `None` if fewer than three photos share points.
pub(super) fn spread_stops(photos: &[Vec<Seen>]) -> Option<f64> {
    let num_points = photos.iter().flatten().map(|seen| seen.point + 1).max()? as usize;
    (0..3).filter_map(|channel| spread_of_channel(photos, num_points, channel)).reduce(f64::max)
}

fn spread_of_channel(photos: &[Vec<Seen>], num_points: usize, channel: usize) -> Option<f64> {
    let mut exposures = vec![0.0; photos.len()];
    let mut known = Vec::new();
    for _ in 0..PASSES {
        let (mut sums, mut counts) = (vec![0.0; num_points], vec![0_u32; num_points]);
        for (photo, exposure) in photos.iter().zip(&exposures) {
            for seen in photo {
                sums[seen.point as usize] += seen.stops[channel] - exposure;
                counts[seen.point as usize] += 1;
            }
        }
        known.clear();
        for (view, photo) in photos.iter().enumerate() {
            // Compared with what the other photos show.
            let differences: Vec<f64> = photo
                .iter()
                .filter(|seen| counts[seen.point as usize] > 1)
                .map(|seen| {
                    let (sum, count) = (sums[seen.point as usize], f64::from(counts[seen.point as usize]));
                    let own = seen.stops[channel];
                    own - (sum - (own - exposures[view])) / (count - 1.0)
                })
                .collect();
            if differences.len() >= POINTS_MIN {
                known.push((view, median(differences).unwrap_or(0.0)));
            }
        }
        for &(view, exposure) in &known {
            exposures[view] = exposure;
        }
    }
    let mut all: Vec<f64> = known.into_iter().map(|(_, exposure)| exposure).collect();
    if all.len() < PHOTOS_MIN {
        return None;
    }
    Some(quantile(&mut all, 0.9)? - quantile(&mut all, 0.1)?)
}
