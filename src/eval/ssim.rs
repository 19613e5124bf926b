//! Structural similarity with the constants of 3DGS, under both common treatments of the image border.
//! The backends implement the SSIM loss of training themselves.

use super::pair::ImagePair;
use crate::constants::{SSIM_C1, SSIM_C2, SSIM_RADIUS_PX, SSIM_SIGMA_PX};
use rayon::prelude::*;

/// Means of one SSIM map over pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ssim {
    /// Over all unmasked pixels, with zeros beyond the border, as published by the 3DGS family.
    pub zero_padded: f64,
    /// Over the unmasked pixels whose window lies inside the image; equal to `zero_padded` if there
    /// are none, for example because the image is smaller than the window.
    pub valid: f64,
}

/// SSIM with an 11 x 11 Gaussian window and biased variances; 1 if every pixel is masked.
pub fn ssim(pair: &ImagePair) -> Ssim {
    let (width, height) = (pair.width_px, pair.height_px);
    let r = SSIM_RADIUS_PX;
    let inside = |x: usize, y: usize| x >= r && y >= r && x + r < width && y + r < height;
    let [mut all, mut valid] = [(0.0, 0_u64); 2];
    for channel in 0..3 {
        let map = ssim_map(pair, channel);
        // One sum per row, then rows in order, which fixes the order of the additions.
        for (y, row) in map.chunks_exact(width.max(1)).enumerate() {
            let [mut row_all, mut row_valid] = [0.0; 2];
            for (x, &value) in row.iter().enumerate() {
                if pair.is_unmasked(x, y) {
                    row_all += value;
                    all.1 += 1;
                    if inside(x, y) {
                        row_valid += value;
                        valid.1 += 1;
                    }
                }
            }
            all.0 += row_all;
            valid.0 += row_valid;
        }
    }
    let mean = |(sum, count): (f64, u64), otherwise| if count == 0 { otherwise } else { sum / count as f64 };
    let zero_padded = mean(all, 1.0);
    Ssim { zero_padded, valid: mean(valid, zero_padded) }
}

/// Normalised taps of the window along one axis.
fn window() -> [f64; 2 * SSIM_RADIUS_PX + 1] {
    let mut taps = [0.0; 2 * SSIM_RADIUS_PX + 1];
    for (i, tap) in taps.iter_mut().enumerate() {
        let d = i as f64 - SSIM_RADIUS_PX as f64;
        *tap = (-d * d / (2.0 * SSIM_SIGMA_PX * SSIM_SIGMA_PX)).exp();
    }
    let sum: f64 = taps.iter().sum();
    taps.map(|t| t / sum)
}

/// SSIM at every pixel of one channel, with zeros beyond the border. `[height, width]`
fn ssim_map(pair: &ImagePair, channel: usize) -> Vec<f64> {
    let (width, height) = (pair.width_px, pair.height_px);
    let taps = window();
    let plane = |image: &[u8]| -> Vec<f64> {
        image[channel.min(image.len())..].iter().step_by(3).map(|&v| f64::from(v) / 255.0).collect()
    };
    let (x, y) = (plane(&pair.rendered), plane(&pair.target));
    // Blurred along rows: E[x], E[y], E[x^2], E[y^2], E[xy]. `[height, width, 5]`
    let mut blurred = vec![[0.0; 5]; width * height];
    blurred.par_chunks_exact_mut(width.max(1)).enumerate().for_each(|(row, out)| {
        let (x, y) = (&x[row * width..(row + 1) * width], &y[row * width..(row + 1) * width]);
        for (column, sums) in out.iter_mut().enumerate() {
            for (at, tap) in taps_within(&taps, column, width) {
                let (a, b) = (x[at], y[at]);
                for (sum, v) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                    *sum += tap * v;
                }
            }
        }
    });
    let mut map = vec![0.0; width * height];
    map.par_chunks_exact_mut(width.max(1)).enumerate().for_each(|(row, out)| {
        for (column, value) in out.iter_mut().enumerate() {
            let mut sums = [0.0; 5];
            for (at, tap) in taps_within(&taps, row, height) {
                for (sum, v) in sums.iter_mut().zip(blurred[at * width + column]) {
                    *sum += tap * v;
                }
            }
            *value = ssim_from_moments(sums);
        }
    });
    map
}

/// Positions in `0..size` covered by the window around `centre`, with their taps.
fn taps_within(taps: &[f64], centre: usize, size: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
    let first = centre.saturating_sub(SSIM_RADIUS_PX);
    let end = (centre + SSIM_RADIUS_PX + 1).min(size);
    (first..end).map(move |at| (at, taps[at + SSIM_RADIUS_PX - centre]))
}

fn ssim_from_moments([mx, my, xx, yy, xy]: [f64; 5]) -> f64 {
    let (vx, vy, cov) = (xx - mx * mx, yy - my * my, xy - mx * my);
    ((2.0 * mx * my + SSIM_C1) * (2.0 * cov + SSIM_C2))
        / ((mx * mx + my * my + SSIM_C1) * (vx + vy + SSIM_C2))
}
