//! Filters of FLIP. Each is a filter along the rows times one along the columns, or a sum of two such; beyond the border
//! an image is continued with its outermost pixels.

use std::f64::consts::PI;

/// Sensitivities to contrasts, as sums of Gaussians `a sqrt(pi / b) exp(-pi^2 d^2 / b)` of the distance d in degrees:
/// channel (Y, Cx, Cz), a and b (paper, table 1).
const SENSITIVITIES: [(usize, f64, f64); 4] =
    [(0, 1.0, 0.0047), (1, 1.0, 0.0053), (2, 34.1, 0.04), (2, 13.5, 0.025)];
/// Gaussians are cut off at this many standard deviations of the widest (paper, 4.1.1 and 4.2.1).
const CUT_OFF: f64 = 3.0;
/// Width of the detectors of edges and points, degrees: two standard deviations (paper, 4.2.1).
const FEATURE_WIDTH_DEG: f64 = 0.082;

/// Taps of a filter along one axis, from -radius to radius.
pub(super) struct Taps(Vec<f32>);

impl Taps {
    pub fn radius_px(&self) -> usize {
        self.0.len() / 2
    }

    /// Adds a filtered row to `out`. `padded` has `pad_px` more pixels at both ends. `out`: `[width]`
    pub fn add_along_row(&self, out: &mut [f32], padded: &[f32], pad_px: usize) {
        let first = pad_px - self.radius_px();
        for (offset, tap) in self.0.iter().enumerate() {
            add_scaled(out, &padded[first + offset..], *tap);
        }
    }

    /// Adds a row to `out`, filtered along the columns. `row_at` returns the row at an offset from it. `out`: `[width]`
    pub fn add_along_columns<'a>(&self, out: &mut [f32], row_at: impl Fn(isize) -> &'a [f32]) {
        for (offset, tap) in (-(self.radius_px() as isize)..).zip(&self.0) {
            add_scaled(out, row_at(offset), *tap);
        }
    }
}

fn add_scaled(out: &mut [f32], values: &[f32], factor: f32) {
    for (sum, value) in out.iter_mut().zip(values) {
        *sum += factor * value;
    }
}

/// A part of the blur of a channel.
pub(super) struct Blur {
    /// Y, Cx or Cz.
    pub channel: usize,
    pub along_row: Taps,
    pub along_columns: Taps,
}

/// The filters for a size of pixels.
pub(super) struct Filters {
    /// What the eye does not resolve; the two parts of the last channel are to be added.
    pub blurs: [Blur; 4],
    /// A Gaussian, its first and its second derivative. Positive taps add up to 1, negative ones to -1.
    pub features: [Taps; 3],
}

impl Filters {
    pub fn new(pixels_per_degree: f64) -> Self {
        Self { blurs: blurs(pixels_per_degree), features: features(pixels_per_degree) }
    }

    pub fn radius_px(&self) -> usize {
        self.blurs[0].along_row.radius_px().max(self.features[0].radius_px())
    }
}

fn blurs(pixels_per_degree: f64) -> [Blur; 4] {
    let widest = SENSITIVITIES.iter().map(|&(_, _, b)| b).fold(0.0, f64::max);
    let distances = distances_px((widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree);
    let gaussian = |b: f64| distances.clone().map(move |d| (-(PI * d / pixels_per_degree).powi(2) / b).exp());
    let weight = |a: f64, b: f64| a * (PI / b).sqrt();
    SENSITIVITIES.map(|(channel, a, b)| {
        let parts = SENSITIVITIES.iter().filter(|part| part.0 == channel);
        let total: f64 = parts.map(|&(_, a, b)| weight(a, b) * gaussian(b).sum::<f64>().powi(2)).sum();
        Blur {
            channel,
            along_row: Taps(gaussian(b).map(|g| (g * weight(a, b) / total) as f32).collect()),
            along_columns: Taps(gaussian(b).map(|g| g as f32).collect()),
        }
    })
}

fn features(pixels_per_degree: f64) -> [Taps; 3] {
    let sigma_px = 0.5 * FEATURE_WIDTH_DEG * pixels_per_degree;
    let gaussian = |d: f64| (-d * d / (2.0 * sigma_px * sigma_px)).exp();
    let first = |d: f64| -d * gaussian(d);
    let second = |d: f64| (d * d / (sigma_px * sigma_px) - 1.0) * gaussian(d);
    [&gaussian as &dyn Fn(f64) -> f64, &first, &second].map(|filter| {
        let taps: Vec<f64> = distances_px(sigma_px).map(filter).collect();
        let sum_of = |sign: f64| taps.iter().filter(|t| **t * sign > 0.0).sum::<f64>().abs();
        let (positive, negative) = (sum_of(1.0), sum_of(-1.0));
        Taps(taps.iter().map(|t| (t / if *t > 0.0 { positive } else { negative }) as f32).collect())
    })
}

/// Distances from the centre of the taps of filters with this standard deviation.
fn distances_px(sigma_px: f64) -> impl Iterator<Item = f64> + Clone {
    let radius = (CUT_OFF * sigma_px).ceil() as i32;
    (-radius..=radius).map(f64::from)
}
