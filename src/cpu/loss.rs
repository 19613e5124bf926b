//! Fused L1, SSIM and MSE terms with their gradient (twin: `reference/loss.rs`). Planes are `[height, width]` f32.
//!
//! No fused multiply-adds: every SIMD level gives the same bits.

use super::simd::dispatch;
use crate::backend::{LossWeights, TargetImage};
use crate::constants::{SSIM_C1, SSIM_C2, SSIM_RADIUS_PX, ssim_window};
use fearless_simd::{Level, Simd};
use rayon::prelude::*;

const TAPS: usize = 2 * SSIM_RADIUS_PX + 1;

/// Planes of image and photo, and working memory of the loss.
#[derive(Default)]
pub(super) struct LossBuffers {
    /// Rendered image, by channel; after [`image_loss`], the derivative with respect to it.
    pub image: [Vec<f32>; 3],
    /// Loss of each pixel: l1 and dssim terms, averaged over the channels only.
    pub map: Vec<f32>,
    target: [Vec<f32>; 3],
    blurred: [Vec<f32>; 5],
    partial: [Vec<f32>; 3],
}

impl LossBuffers {
    /// Resizes all planes to an image, and clears the map.
    pub(super) fn resize(&mut self, num_pixels: usize) {
        for plane in self.image.iter_mut().chain(&mut self.target).chain(&mut self.partial) {
            plane.resize(num_pixels, 0.0);
        }
        self.blurred.iter_mut().for_each(|plane| plane.resize(num_pixels, 0.0));
        self.map.clear();
        self.map.resize(num_pixels, 0.0);
    }
}

/// Weighted l1, dssim and mse terms of the image over a background; writes gradient and map to the buffers.
pub(super) fn image_loss(
    level: Level,
    buffers: &mut LossBuffers,
    (target, background): (&TargetImage, [f32; 3]),
    weights: &LossWeights,
) -> [f64; 3] {
    let w = target.width_px as usize;
    let window = ssim_window().map(|w| w as f32);
    let count = target.rgb.len() as f32;
    let mut sums = [0.0_f64; 3];
    for channel in 0..3 {
        load_target(buffers, (target, background), channel);
        blur_rows(level, &buffers.image[channel], &buffers.target[channel], &mut buffers.blurred, w, &window);
        let scale = weights.dssim / count;
        let ssim_sum = ssim_rows(level, buffers, w, &window, scale);
        sums[1] +=
            f64::from(weights.dssim) * (target.rgb.len() as f64 / 3.0 - ssim_sum) / target.rgb.len() as f64;
        let [p0, p1, p2, ..] = &mut buffers.blurred;
        blur_partials(level, &buffers.partial, [p0, p1, p2], w, &window);
        let (l1, mse) = combine(level, buffers, channel, w, &window, weights, count);
        sums[0] += l1;
        sums[2] += mse;
        if target.mask.is_some() {
            clear_masked(&mut buffers.image[channel], target);
        }
    }
    sums
}

fn load_target(buffers: &mut LossBuffers, (target, background): (&TargetImage, [f32; 3]), channel: usize) {
    let LossBuffers { image, target: planes, .. } = buffers;
    let (x, y) = (&mut image[channel], &mut planes[channel]);
    y.par_iter_mut().with_min_len(4096).enumerate().for_each(|(i, y)| {
        *y = target.colour(i, background)[channel];
    });
    // A masked pixel counts as equal to the photo.
    if let Some(mask) = &target.mask {
        x.par_iter_mut().zip(y.par_iter()).zip(mask).with_min_len(4096).for_each(|((x, y), m)| {
            if *m == 0 {
                *x = *y;
            }
        });
    }
}

fn clear_masked(gradient: &mut [f32], target: &TargetImage) {
    for (g, m) in gradient.iter_mut().zip(target.mask.iter().flatten()) {
        if *m == 0 {
            *g = 0.0;
        }
    }
}

/// Blurs x, y, xx, yy and xy along the rows.
fn blur_rows(level: Level, x: &[f32], y: &[f32], out: &mut [Vec<f32>; 5], w: usize, window: &[f32; TAPS]) {
    let [o0, o1, o2, o3, o4] = out;
    let rows = (
        o0.par_chunks_mut(w),
        o1.par_chunks_mut(w),
        o2.par_chunks_mut(w),
        o3.par_chunks_mut(w),
        o4.par_chunks_mut(w),
    );
    rows.into_par_iter().zip((x.par_chunks(w), y.par_chunks(w))).for_each_init(
        || vec![0.0; w + 2 * SSIM_RADIUS_PX],
        |padded, ((o0, o1, o2, o3, o4), (x, y))| {
            dispatch!(level, simd => blur_products(simd, x, y, padded, [o0, o1, o2, o3, o4], window));
        },
    );
}

/// The five blurs of a row. `padded` is scratch memory with zero margins.
#[inline(always)]
fn blur_products<S: Simd>(
    simd: S,
    x: &[f32],
    y: &[f32],
    padded: &mut [f32],
    [o0, o1, o2, o3, o4]: [&mut [f32]; 5],
    window: &[f32; TAPS],
) {
    let inner = SSIM_RADIUS_PX..SSIM_RADIUS_PX + x.len();
    padded[inner.clone()].copy_from_slice(x);
    blur_padded(simd, padded, o0, window);
    padded[inner.clone()].copy_from_slice(y);
    blur_padded(simd, padded, o1, window);
    for ([a, b], out) in [[x, x], [y, y], [x, y]].into_iter().zip([o2, o3, o4]) {
        for ((p, a), b) in padded[inner.clone()].iter_mut().zip(a).zip(b) {
            *p = a * b;
        }
        blur_padded(simd, padded, out, window);
    }
}

/// `out[i] = sum over k of window[k] * padded[i + k]`.
#[inline(always)]
fn blur_padded<S: Simd>(_simd: S, padded: &[f32], out: &mut [f32], window: &[f32; TAPS]) {
    let n = out.len();
    let taps: [&[f32]; TAPS] = std::array::from_fn(|k| &padded[k..k + n]);
    for i in 0..n {
        let mut sum = window[SSIM_RADIUS_PX] * taps[SSIM_RADIUS_PX][i];
        for k in 0..SSIM_RADIUS_PX {
            sum += window[k] * (taps[k][i] + taps[TAPS - 1 - k][i]);
        }
        out[i] = sum;
    }
}

/// `out[i] = sum over k of window[k] * plane[y + k - radius][i]`, zero outside the plane.
#[inline(always)]
fn blur_column<S: Simd>(_simd: S, plane: &[f32], y: usize, w: usize, out: &mut [f32], window: &[f32; TAPS]) {
    out.fill(0.0);
    let h = plane.len() / w;
    for (k, weight) in window.iter().enumerate() {
        let Some(row) = (y + k).checked_sub(SSIM_RADIUS_PX).filter(|&r| r < h) else {
            continue;
        };
        let row = &plane[row * w..(row + 1) * w];
        for (o, v) in out.iter_mut().zip(row) {
            *o += weight * v;
        }
    }
}

/// Blurs along the columns, then computes SSIM and its derivatives w.r.t. the three means that depend on the image, times
/// `scale`; adds (1 - SSIM) to the map. Returns the sum of SSIM.
fn ssim_rows(level: Level, buffers: &mut LossBuffers, w: usize, window: &[f32; TAPS], scale: f32) -> f64 {
    let LossBuffers { blurred, partial, map, .. } = buffers;
    let [p0, p1, p2] = partial;
    let rows = (p0.par_chunks_mut(w), p1.par_chunks_mut(w), p2.par_chunks_mut(w), map.par_chunks_mut(w));
    let row_sums: Vec<f64> = rows
        .into_par_iter()
        .enumerate()
        .map_init(
            || vec![vec![0.0; w]; 6],
            |means, (y, (p0, p1, p2, map))| {
                dispatch!(level, simd => {
                    ssim_row(simd, blurred, means, y, window, scale, [p0, p1, p2, map]);
                });
                means[5].iter().map(|&s| f64::from(s)).sum::<f64>()
            },
        )
        .collect();
    row_sums.iter().sum()
}

/// One row of [`ssim_rows`]. `means` is scratch memory whose last row receives SSIM.
#[inline(always)]
fn ssim_row<S: Simd>(
    simd: S,
    blurred: &[Vec<f32>; 5],
    means: &mut [Vec<f32>],
    y: usize,
    window: &[f32; TAPS],
    scale: f32,
    [p0, p1, p2, map]: [&mut [f32]; 4],
) {
    let w = map.len();
    for (mean, plane) in means.iter_mut().zip(blurred.iter()) {
        blur_column(simd, plane, y, w, mean, window);
    }
    let [mx, my, mxx, myy, mxy, ssim] = means else { return };
    let (mx, my, mxx, myy, mxy, ssim) = (&mx[..w], &my[..w], &mxx[..w], &myy[..w], &mxy[..w], &mut ssim[..w]);
    let (p0, p1, p2) = (&mut p0[..w], &mut p1[..w], &mut p2[..w]);
    // `scale` contains the mean over all values of the image; the map has only the mean over a pixel's channels.
    let per_channel = scale * blurred[0].len() as f32;
    for i in 0..w {
        let (mx, my) = (mx[i], my[i]);
        let a1 = 2.0 * mx * my + SSIM_C1 as f32;
        let a2 = 2.0 * (mxy[i] - mx * my) + SSIM_C2 as f32;
        let b1 = mx * mx + my * my + SSIM_C1 as f32;
        // Rounding may make a variance negative.
        let b2 = (mxx[i] - mx * mx).max(0.0) + (myy[i] - my * my).max(0.0) + SSIM_C2 as f32;
        let per = 1.0 / (b1 * b2);
        let s = a1 * a2 * per;
        p0[i] = -scale * (2.0 * my * (a2 - a1) * per + 2.0 * mx * s * (b1 - b2) * per);
        p1[i] = scale * s * b1 * per;
        p2[i] = -scale * 2.0 * a1 * per;
        ssim[i] = s;
        map[i] += per_channel * (1.0 - s);
    }
}

/// Blurs the three derivative planes along the rows.
fn blur_partials(
    level: Level,
    planes: &[Vec<f32>; 3],
    out: [&mut Vec<f32>; 3],
    w: usize,
    window: &[f32; TAPS],
) {
    for (plane, out) in planes.iter().zip(out) {
        out.par_chunks_mut(w).zip(plane.par_chunks(w)).for_each_init(
            || vec![0.0; w + 2 * SSIM_RADIUS_PX],
            |padded, (out, row)| {
                padded[SSIM_RADIUS_PX..SSIM_RADIUS_PX + w].copy_from_slice(row);
                dispatch!(level, simd => blur_padded(simd, padded, out, window));
            },
        );
    }
}

/// Blurs the derivative planes along the columns and adds the pixel-wise terms; the gradient replaces the
/// image's plane. Returns the l1 and mse terms.
fn combine(
    level: Level,
    buffers: &mut LossBuffers,
    channel: usize,
    w: usize,
    window: &[f32; TAPS],
    weights: &LossWeights,
    count: f32,
) -> (f64, f64) {
    let LossBuffers { image, map, target, blurred, .. } = buffers;
    let rows = (image[channel].par_chunks_mut(w), map.par_chunks_mut(w), target[channel].par_chunks(w));
    let row_sums: Vec<(f64, f64)> = rows
        .into_par_iter()
        .enumerate()
        .map_init(
            || vec![vec![0.0; w]; 3],
            |columns, (y, (x, map, t))| {
                let (mut abs_sum, mut square_sum) = (0.0_f64, 0.0_f64);
                for (x, t) in x.iter().zip(t) {
                    let d = f64::from(x - t);
                    abs_sum += d.abs();
                    square_sum += d * d;
                }
                let rates = [weights.l1 / count, 2.0 * weights.mse / count, weights.l1 / 3.0];
                dispatch!(level, simd => combine_row(simd, blurred, columns, y, window, rates, [x, map], t));
                (abs_sum, square_sum)
            },
        )
        .collect();
    let (abs_sum, square_sum) = row_sums.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    (
        f64::from(weights.l1) * abs_sum / f64::from(count),
        f64::from(weights.mse) * square_sum / f64::from(count),
    )
}

/// One row of [`combine`]. `columns` is scratch memory; `[l1, mse, map_l1]` are the weights of the L1 gradient,
/// of the MSE gradient, and of L1 in the map.
#[allow(clippy::too_many_arguments, reason = "inlined into its only caller; split for reading")]
#[inline(always)]
fn combine_row<S: Simd>(
    simd: S,
    blurred: &[Vec<f32>; 5],
    columns: &mut [Vec<f32>],
    y: usize,
    window: &[f32; TAPS],
    [l1, mse, map_l1]: [f32; 3],
    [x, map]: [&mut [f32]; 2],
    t: &[f32],
) {
    let w = x.len();
    for (column, plane) in columns.iter_mut().zip(blurred.iter()) {
        blur_column(simd, plane, y, w, column, window);
    }
    let [c0, c1, c2] = columns else { return };
    let (c0, c1, c2, map, t) = (&c0[..w], &c1[..w], &c2[..w], &mut map[..w], &t[..w]);
    for i in 0..w {
        let d = x[i] - t[i];
        let sign = f32::from(u8::from(d > 0.0)) - f32::from(u8::from(d < 0.0));
        map[i] += map_l1 * d.abs();
        x[i] = l1 * sign + mse * d + c0[i] + 2.0 * x[i] * c1[i] + t[i] * c2[i];
    }
}
