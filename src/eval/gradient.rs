//! PSNR of image gradients, a measure of texture detail. Plain PSNR hardly registers it: most of a
//! photo's energy lies in the low frequencies, so blurred renders score well.

use super::pair::ImagePair;
use super::psnr::{PSNR_CAP_DB, psnr_from_mse};
use rayon::prelude::*;

/// PSNR (peak 1) of the Sobel gradients of the channel mean, dB.
///
/// Taps 1-2-1 across and -1, 0, 1 along, divided by 8, so that the gradient of a ramp is its slope.
/// Evaluated where the 3 x 3 window lies inside the image and contains no masked pixel; the squared
/// error is averaged over both components. [`PSNR_CAP_DB`] if no window qualifies.
pub fn gradient_psnr(pair: &ImagePair) -> f64 {
    let (width, height) = (pair.width_px, pair.height_px);
    if width < 3 || height < 3 {
        return PSNR_CAP_DB;
    }
    // Sobel is linear, so filter the difference once instead of each image.
    let difference: Vec<i32> = pair
        .rendered
        .chunks_exact(3)
        .zip(pair.target.chunks_exact(3))
        .map(|(a, b)| (0..3).map(|c| i32::from(a[c]) - i32::from(b[c])).sum())
        .collect();
    let at = |x: usize, y: usize| difference[y * width + x];
    let (sum, windows) = (1..height - 1)
        .into_par_iter()
        .map(|y| {
            let (mut sum, mut windows) = (0_u64, 0_u64);
            for x in 1..width - 1 {
                if !(y - 1..=y + 1).all(|v| (x - 1..=x + 1).all(|u| pair.is_unmasked(u, v))) {
                    continue;
                }
                let column = |u: usize| at(u, y - 1) + 2 * at(u, y) + at(u, y + 1);
                let row = |v: usize| at(x - 1, v) + 2 * at(x, v) + at(x + 1, v);
                let dx = i64::from(column(x + 1) - column(x - 1));
                let dy = i64::from(row(y + 1) - row(y - 1));
                sum += (dx * dx + dy * dy) as u64;
                windows += 1;
            }
            (sum, windows)
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    if windows == 0 {
        return PSNR_CAP_DB;
    }
    // Undoes the integer scale: 3 summed channels, taps that sum to 8, 255 code values.
    let unit = 3.0 * 8.0 * 255.0;
    psnr_from_mse(sum as f64 / (2.0 * windows as f64 * unit * unit))
}
