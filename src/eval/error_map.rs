//! Error maps: where a render differs from its photo.

use super::pair::ImagePair;
use crate::image::{TargetImage, magma};

/// Mean absolute difference over the channels, in [0, 1], that reaches the brightest colour.
pub const ERROR_MAP_MAX: f64 = 0.25;

/// Absolute error, averaged over the channels, on the magma ramp from black (0) to bright yellow
/// ([`ERROR_MAP_MAX`] and above); masked pixels are mid-grey. `[height, width, 3]`
///
/// # Panics
/// If the render (display space, `[height, width, 3]`) and its photo differ in size.
pub fn error_map(rendered_rgb: &[f32], target: &TargetImage) -> Vec<u8> {
    let pair = ImagePair::new(rendered_rgb, target);
    // A lookup table: the sum over the channels takes only 766 values.
    let colours: Vec<[u8; 3]> =
        (0..=3 * 255_u32).map(|sum| magma(f64::from(sum) / (3.0 * 255.0 * ERROR_MAP_MAX))).collect();
    pair.rendered
        .chunks_exact(3)
        .zip(pair.target.chunks_exact(3))
        .enumerate()
        .flat_map(|(pixel, (a, b))| {
            if pair.unmasked.as_ref().is_none_or(|u| u[pixel]) {
                colours[(0..3).map(|c| usize::from(a[c].abs_diff(b[c]))).sum::<usize>()]
            } else {
                [128; 3]
            }
        })
        .collect()
}
