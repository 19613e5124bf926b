//! The significance of a photo's frequencies: the spectrum of the photo weighted by its own gradient (method 7.1).
//! Photos with fine detail where they have contrast require fine images.

use super::fft::PlaneTransform;
use super::noise;
use super::spectrum::{Lines, Spectrum};
use crate::image::TargetImage;

/// W = clip(1 + 1.5 G, 1, 3) with G in 0..1 (paper), so that the upper clip never acts.
const GRADIENT_GAIN: f64 = 1.5;
const WEIGHT_MAX: f64 = 3.0;

/// Added to the range of the gradient before dividing by it (authors' code).
const RANGE_EPSILON: f64 = 1e-6;

/// Photos whose grey values span less than this are not weighted: normalisation would amplify rounding, or the step
/// to the zero padding, to full range. Half a step of 8 bits.
const RANGE_MIN: f64 = 0.5 / 255.0;

/// Channels of a photo, 0 to 1. `[3][height, width]`
type Planes = [Vec<f64>; 3];

/// The spectrum of a photo's significance: |FFT2(W I)|, summed over channels. `None` for a wholly masked photo.
pub(super) fn spectrum(photo: &TargetImage, transform: &PlaneTransform) -> Option<Spectrum> {
    let (width, height) = (photo.width_px as usize, photo.height_px as usize);
    let mut planes = planes(photo)?;
    let weights = weights(&planes, width, height);
    let mut lines = Lines::new(width, height);
    let mut work = transform.workspace();
    for plane in &mut planes {
        for (value, weight) in plane.iter_mut().zip(&weights) {
            *value *= weight;
        }
        transform.visit_columns(plane, &mut work, |kx, column| lines.add_column(kx, column));
    }
    let counts = |i: usize| photo.counts(i);
    let squares = weights.iter().enumerate().filter(|&(i, _)| counts(i)).map(|(_, w)| w * w);
    Some(Spectrum {
        cells: lines.cells(),
        mean_square_weight: squares.sum::<f64>() / weights.len() as f64,
        fine_variance: noise::fine_variance(photo),
    })
}

/// Channels as numbers from 0 to 1, masked pixels replaced by the mean of the others.
///
/// Nothing is learnt from masked pixels, so their detail must not require resolution. Of all constants the mean
/// makes the smallest step at the edge of the mask, which is not detail either; black would make the mask's outline
/// the strongest edge of most images.
fn planes(photo: &TargetImage) -> Option<Planes> {
    let value = |byte: u8| f64::from(byte) / 255.0;
    let pixels = photo.rgb.as_chunks::<3>().0;
    let Some(mask) = &photo.mask else {
        return Some([0, 1, 2].map(|c| pixels.iter().map(|p| value(p[c])).collect()));
    };
    let num = mask.iter().filter(|&&m| m != 0).count();
    if num == 0 {
        return None;
    }
    Some([0, 1, 2].map(|c| {
        let counting = pixels.iter().zip(mask).filter(|&(_, &m)| m != 0);
        let mean = value(1) * counting.map(|(p, _)| f64::from(p[c])).sum::<f64>() / num as f64;
        pixels.iter().zip(mask).map(|(p, &m)| if m != 0 { value(p[c]) } else { mean }).collect()
    }))
}

/// W, from the Sobel gradient of the mean over channels (taps 1-2-1, unnormalised, zeros outside).
fn weights(planes: &Planes, width: usize, height: usize) -> Vec<f64> {
    let grey: Vec<f64> =
        (0..width * height).map(|i| planes.iter().map(|p| p[i]).sum::<f64>() / 3.0).collect();
    let (low, high) = range(&grey);
    if high - low < RANGE_MIN {
        return vec![1.0; grey.len()];
    }
    let mut magnitudes = vec![0.0; grey.len()];
    let zeros = vec![0.0; width];
    let row = |y: usize| &grey[y * width..(y + 1) * width];
    for (y, out) in magnitudes.chunks_exact_mut(width).enumerate() {
        let above = if y > 0 { row(y - 1) } else { &zeros };
        let below = if y + 1 < height { row(y + 1) } else { &zeros };
        let here = row(y);
        // The smoothed value and the difference of a column of three.
        let smooth = |x: usize| above[x] + 2.0 * here[x] + below[x];
        let slope = |x: usize| below[x] - above[x];
        let (mut left, mut middle) = ((0.0, 0.0), (smooth(0), slope(0)));
        for (x, magnitude) in out.iter_mut().enumerate() {
            let right = if x + 1 < width { (smooth(x + 1), slope(x + 1)) } else { (0.0, 0.0) };
            let (gx, gy) = (right.0 - left.0, left.1 + 2.0 * middle.1 + right.1);
            *magnitude = (gx * gx + gy * gy).sqrt();
            (left, middle) = (middle, right);
        }
    }
    let (low, high) = range(&magnitudes);
    let gain = GRADIENT_GAIN / (high - low + RANGE_EPSILON);
    magnitudes.iter().map(|m| (1.0 + gain * (m - low)).clamp(1.0, WEIGHT_MAX)).collect()
}

fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
}
