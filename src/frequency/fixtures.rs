//! Photos with known spectra for tests.

use super::{FrequencyOptions, FrequencySchedule, RuleSet, ScheduleRules};
use crate::camera::{Camera, Pinhole, RigidTransform};
use crate::image::TargetImage;
use crate::views::{Split, TestViews};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Training views of these photos.
pub(super) fn views(photos: Vec<TargetImage>) -> TestViews {
    let view = |photo: TargetImage| {
        let (width_px, height_px) = (photo.width_px, photo.height_px);
        let pinhole = Pinhole { width_px, height_px, fx_px: 1.0, fy_px: 1.0, cx_px: 0.0, cy_px: 0.0 };
        let camera = Camera { pinhole, camera_from_local: RigidTransform::IDENTITY };
        ("photo", camera, Arc::new(photo))
    };
    TestViews(Split::Train, photos.into_iter().map(view).collect())
}

/// A photo of these values, 0 to 1, by pixel index.
pub(super) fn photo(width: usize, height: usize, mut rgb: impl FnMut(usize) -> [f64; 3]) -> TargetImage {
    let byte = |v: f64| (v * 255.0).round().clamp(0.0, 255.0) as u8;
    TargetImage::opaque(
        width as u32,
        height as u32,
        (0..width * height).flat_map(|i| rgb(i).map(byte)).collect(),
    )
}

/// A standard normal number (Box and Muller).
fn normal(random: &mut Pcg64Mcg) -> f64 {
    let (a, b): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
}

/// Grey values with random phases and amplitudes that fall as |f|^-exponent, mean 0.5, standard
/// deviation 0.15. `[height, width]`
pub(super) fn fractal(width: usize, height: usize, exponent: f64, seed: u64) -> Vec<f64> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let cycles = |k: usize, side: usize| k.min(side - k) as f64 / side as f64;
    let mut plane: Vec<Complex<f64>> = (0..width * height)
        .map(|i| {
            let f = cycles(i % width, width).hypot(cycles(i / width, height));
            let amplitude = if f > 0.0 { f.powf(-exponent) } else { 0.0 };
            Complex::new(normal(&mut random), normal(&mut random)) * amplitude
        })
        .collect();
    let mut planner = FftPlanner::new();
    planner.plan_fft_inverse(width).process(&mut plane);
    let mut columns: Vec<Complex<f64>> =
        (0..width * height).map(|i| plane[i % height * width + i / height]).collect();
    planner.plan_fft_inverse(height).process(&mut columns);
    let values: Vec<f64> = (0..width * height).map(|i| columns[i % width * height + i / width].re).collect();
    let num = values.len() as f64;
    let mean = values.iter().sum::<f64>() / num;
    let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / num).sqrt();
    values.iter().map(|v| 0.5 + 0.15 * (v - mean) / deviation).collect()
}

/// A grey photo with independent noise of standard deviation `sigma` on every channel.
pub(super) fn noisy(width: usize, height: usize, values: &[f64], sigma: f64) -> TargetImage {
    let mut random = Pcg64Mcg::seed_from_u64(99);
    photo(width, height, |i| [0; 3].map(|_: i32| values[i] + sigma * normal(&mut random)))
}

/// The schedule of these photos.
pub(super) fn schedule_of(photos: Vec<TargetImage>, options: &FrequencyOptions) -> FrequencySchedule {
    schedule_by(photos, options, &options.rules.set())
}

/// The schedule of these photos by rules of its own.
pub(super) fn schedule_by(
    photos: Vec<TargetImage>,
    options: &FrequencyOptions,
    rules: &RuleSet,
) -> FrequencySchedule {
    FrequencySchedule::analyse_by(&views(photos), options, rules).unwrap()
}

/// The published settings.
pub(super) fn paper() -> FrequencyOptions {
    FrequencyOptions { rules: ScheduleRules::Paper, ..FrequencyOptions::default() }
}
