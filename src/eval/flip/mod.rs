//! FLIP: the difference that a viewer perceives who flips between two images. The variant for images of low dynamic range,
//! from the formulas of P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström and M. D. Fairchild, "FLIP: A
//! Difference Evaluator for Alternating Images", 2020 ("paper").

mod colour;
mod filters;
mod percept;

use super::pair::ImagePair;
use colour::ColourSpaces;
use filters::Filters;
use percept::percepts;
use rayon::prelude::*;

/// Pixels per degree of the field of view, the metric's default: a 4K screen 0.7 m wide, viewed from 0.7 m.
const PIXELS_PER_DEGREE: f64 = 67.0;
/// Rows that a thread computes at a time. Filters reach 10 more on both sides, which are computed twice.
const BAND_ROWS: usize = 64;

/// Mean LDR-FLIP error over the unmasked pixels, 0 to 1; 0 if every pixel is masked. Assumes 67 pixels per degree.
pub fn mean_flip(pair: &ImagePair) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u64);
    for (pixel, error) in flip_errors(pair, PIXELS_PER_DEGREE).into_iter().enumerate() {
        if pair.unmasked.as_ref().is_none_or(|u| u[pixel]) {
            sum += f64::from(error);
            count += 1;
        }
    }
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// The error of each pixel, 0 to 1. `[height, width]`
fn flip_errors(pair: &ImagePair, pixels_per_degree: f64) -> Vec<f32> {
    let (spaces, filters) = (ColourSpaces::new(), Filters::new(pixels_per_degree));
    let mut errors = vec![0.0; pair.width_px * pair.height_px];
    let band_pixels = BAND_ROWS * pair.width_px;
    errors.par_chunks_mut(band_pixels.max(1)).enumerate().for_each(|(band, errors)| {
        let first = band * BAND_ROWS;
        let rows = first..first + errors.len() / pair.width_px;
        let [rendered, target] = [&pair.rendered, &pair.target]
            .map(|codes| percepts(codes, pair.width_px, rows.clone(), &spaces, &filters));
        for ((error, a), b) in errors.iter_mut().zip(&rendered).zip(&target) {
            *error = a.difference(b, &spaces);
        }
    });
    errors
}

#[cfg(test)]
mod tests;
