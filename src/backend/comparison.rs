//! Squared differences between images and photos.

use super::exposure::ColourMap;
use crate::image::TargetImage;
use rayon::prelude::*;

/// Pixels that a thread sums at a time.
const CHUNK_PIXELS: usize = 1 << 14;

/// Mean squared difference over pixels and channels between an image, `[height, width, 3]`, and a photo over a background;
/// pixels that the mask leaves out differ by 0.
pub(super) fn squared_error(
    image: &[f32],
    exposure: &ColourMap,
    target: &TargetImage,
    background: [f32; 3],
) -> f64 {
    let of_pixel = |pixel: usize, rgb: &[f32]| {
        if target.mask.as_ref().is_some_and(|mask| mask[pixel] == 0) {
            return 0.0;
        }
        let shown = exposure.apply([rgb[0], rgb[1], rgb[2]]);
        let differences = shown.into_iter().zip(target.colour(pixel, background));
        differences.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
    };
    let of_chunk = |(chunk, rgb): (usize, &[f32])| -> f64 {
        let pixels = rgb.chunks_exact(3).enumerate();
        pixels.map(|(i, rgb)| of_pixel(chunk * CHUNK_PIXELS + i, rgb)).sum()
    };
    // Added in order, whatever the number of threads.
    let chunks: Vec<f64> = image.par_chunks(3 * CHUNK_PIXELS).enumerate().map(of_chunk).collect();
    chunks.iter().sum::<f64>() / image.len() as f64
}
