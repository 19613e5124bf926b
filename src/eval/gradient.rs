//! PSNR of image gradients: says whether texture detail is there, which PSNR hardly does. Blurred
//! photos score high in PSNR because most of a photo's energy lies in low frequencies.

use super::pair::ImagePair;
use super::psnr::{PSNR_CAP_DB, psnr_from_mse};
use rayon::prelude::*;

/// PSNR (peak 1) of the Sobel gradients of the channel mean, dB.
///
/// Taps 1-2-1 across and -1, 0, 1 along, divided by 8, so that a ramp has its own slope. Only where
/// the 3 x 3 window fits and all of its pixels count; the squared error is the mean over both
/// components. The cap if there is no such place.
pub fn gradient_psnr(pair: &ImagePair) -> f64 {
    let (width, height) = (pair.width_px, pair.height_px);
    if width < 3 || height < 3 {
        return PSNR_CAP_DB;
    }
    // Gradients are linear: that of the difference is the difference of the gradients.
    let difference: Vec<i32> = pair
        .rendered
        .chunks_exact(3)
        .zip(pair.target.chunks_exact(3))
        .map(|(a, b)| (0..3).map(|c| i32::from(a[c]) - i32::from(b[c])).sum())
        .collect();
    let at = |x: usize, y: usize| difference[y * width + x];
    let (sum, places) = (1..height - 1)
        .into_par_iter()
        .map(|y| {
            let (mut sum, mut places) = (0_u64, 0_u64);
            for x in 1..width - 1 {
                if !(y - 1..=y + 1).all(|v| (x - 1..=x + 1).all(|u| pair.counts_at(u, v))) {
                    continue;
                }
                let column = |u: usize| at(u, y - 1) + 2 * at(u, y) + at(u, y + 1);
                let row = |v: usize| at(x - 1, v) + 2 * at(x, v) + at(x + 1, v);
                let dx = i64::from(column(x + 1) - column(x - 1));
                let dy = i64::from(row(y + 1) - row(y - 1));
                sum += (dx * dx + dy * dy) as u64;
                places += 1;
            }
            (sum, places)
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    if places == 0 {
        return PSNR_CAP_DB;
    }
    // 3: channels in the mean, 8: taps, 255: code values, 2: components.
    let unit = 3.0 * 8.0 * 255.0;
    psnr_from_mse(sum as f64 / (2.0 * places as f64 * unit * unit))
}
