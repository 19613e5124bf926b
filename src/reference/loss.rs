//! L1, SSIM and MSE terms of an image against a photo, and their derivative w.r.t. every pixel (method section 3).
//!
//! Masked pixels count as equal to the photo; means are over all pixels of the image.

use crate::backend::{LossValues, LossWeights, TargetImage};
use crate::constants::{SSIM_C1, SSIM_C2, SSIM_RADIUS_PX, ssim_window};
use crate::image::ALPHA_LEVELS;

/// Loss of an image.
pub struct ImageLoss {
    /// The terms `l1`, `dssim` and `mse`, weighted; the others are zero.
    pub values: LossValues,
    /// Derivative with respect to the image. `[height, width, 3]`
    pub gradient: Vec<f64>,
    /// Loss of each pixel for the window statistics: the l1 and dssim terms, averaged over the channels only.
    /// `[height, width]`
    pub map: Vec<f64>,
}

/// Loss, gradient and per-pixel map of the image `rgb`, rendered over `background`. `[height, width, 3]`
pub fn image_loss(
    rgb: &[f64],
    target: &TargetImage,
    background: [f64; 3],
    weights: &LossWeights,
) -> ImageLoss {
    let (w, h) = (target.width_px as usize, target.height_px as usize);
    let y: Vec<f64> = (0..w * h).flat_map(|pixel| colour(target, pixel, background)).collect();
    let x: Vec<f64> = (0..rgb.len()).map(|i| if target.counts(i / 3) { rgb[i] } else { y[i] }).collect();
    let count = (3 * w * h) as f64;
    let (l1, dssim, mse) = (f64::from(weights.l1), f64::from(weights.dssim), f64::from(weights.mse));
    let mut values = LossValues::default();
    let mut gradient = vec![0.0; x.len()];
    let mut map = vec![0.0; w * h];
    for i in 0..x.len() {
        let d = x[i] - y[i];
        values.l1 += l1 * d.abs() / count;
        values.mse += mse * d * d / count;
        let sign = if d == 0.0 { 0.0 } else { d.signum() };
        gradient[i] = l1 * sign / count + 2.0 * mse * d / count;
        map[i / 3] += l1 * d.abs() / 3.0;
    }
    for c in 0..3 {
        let channel = |v: &[f64]| v.iter().skip(c).step_by(3).copied().collect::<Vec<_>>();
        let (ssim, by_x) = ssim_channel(&channel(&x), &channel(&y), w, h);
        for i in 0..w * h {
            values.dssim += dssim * (1.0 - ssim[i]) / count;
            gradient[3 * i + c] -= dssim * by_x[i] / count;
            map[i] += dssim * (1.0 - ssim[i]) / 3.0;
        }
    }
    for i in 0..x.len() {
        if !target.counts(i / 3) {
            gradient[i] = 0.0;
        }
    }
    ImageLoss { values, gradient, map }
}

/// The photo's colour of a pixel over a background, 0 to 1.
pub fn colour(target: &TargetImage, pixel: usize, background: [f64; 3]) -> [f64; 3] {
    let levels = f64::from(ALPHA_LEVELS);
    let opacity = target.alpha.as_ref().map_or(1.0, |alpha| f64::from(alpha[pixel]) / levels);
    [0, 1, 2].map(|c| f64::from(target.rgb[3 * pixel + c]) / 255.0 + (1.0 - opacity) * background[c])
}

/// SSIM map of a channel, and the derivative of its sum with respect to `x`. `[height, width]`
fn ssim_channel(x: &[f64], y: &[f64], w: usize, h: usize) -> (Vec<f64>, Vec<f64>) {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<_>>();
    let mean_x = blur(x, w, h);
    let mean_y = blur(y, w, h);
    let mean_xx = blur(&product(x, x), w, h);
    let mean_yy = blur(&product(y, y), w, h);
    let mean_xy = blur(&product(x, y), w, h);
    let mut ssim = vec![0.0; w * h];
    let mut by_mean_x = vec![0.0; w * h];
    let mut by_mean_xx = vec![0.0; w * h];
    let mut by_mean_xy = vec![0.0; w * h];
    for i in 0..w * h {
        let (mx, my) = (mean_x[i], mean_y[i]);
        let a1 = 2.0 * mx * my + SSIM_C1;
        let a2 = 2.0 * (mean_xy[i] - mx * my) + SSIM_C2;
        let b1 = mx * mx + my * my + SSIM_C1;
        let b2 = mean_xx[i] - mx * mx + mean_yy[i] - my * my + SSIM_C2;
        let s = a1 * a2 / (b1 * b2);
        ssim[i] = s;
        by_mean_x[i] = 2.0 * my * (a2 - a1) / (b1 * b2) + 2.0 * mx * s * (1.0 / b2 - 1.0 / b1);
        by_mean_xx[i] = -s / b2;
        by_mean_xy[i] = 2.0 * a1 / (b1 * b2);
    }
    let (d1, d2, d3) = (blur(&by_mean_x, w, h), blur(&by_mean_xx, w, h), blur(&by_mean_xy, w, h));
    let by_x = (0..w * h).map(|i| d1[i] + 2.0 * x[i] * d2[i] + y[i] * d3[i]).collect();
    (ssim, by_x)
}

/// Convolution with the Gaussian window and zero padding; its own adjoint.
fn blur(values: &[f64], w: usize, h: usize) -> Vec<f64> {
    let window = ssim_window();
    let tap = |i: usize, k: usize, size: usize| (i + k).checked_sub(SSIM_RADIUS_PX).filter(|&j| j < size);
    let mut rows = vec![0.0; w * h];
    for (i, out) in rows.iter_mut().enumerate() {
        let (x, y) = (i % w, i / w);
        *out = (0..window.len()).filter_map(|k| tap(x, k, w).map(|j| window[k] * values[y * w + j])).sum();
    }
    let mut out = vec![0.0; w * h];
    for (i, out) in out.iter_mut().enumerate() {
        let (x, y) = (i % w, i / w);
        *out = (0..window.len()).filter_map(|k| tap(y, k, h).map(|j| window[k] * rows[j * w + x])).sum();
    }
    out
}
