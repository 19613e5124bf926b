//! Images of where two images differ.

use super::pair::ImagePair;
use crate::image::{TargetImage, magma};

/// Mean absolute difference of the channels (of 1) that has the brightest colour.
pub const ERROR_MAP_MAX: f64 = 0.25;

/// Absolute error, averaged over the channels, on the magma ramp: black 0, bright yellow
/// [`ERROR_MAP_MAX`] and more; pixels that do not count are mid-grey. `[height, width, 3]`
///
/// # Panics
/// If the image (display space, `[height, width, 3]`) and its photo differ in size.
pub fn error_map(rendered_rgb: &[f32], target: &TargetImage) -> Vec<u8> {
    let pair = ImagePair::new(rendered_rgb, target);
    // 766 possible sums: one table.
    let colours: Vec<[u8; 3]> =
        (0..=3 * 255_u32).map(|sum| magma(f64::from(sum) / (3.0 * 255.0 * ERROR_MAP_MAX))).collect();
    pair.rendered
        .chunks_exact(3)
        .zip(pair.target.chunks_exact(3))
        .enumerate()
        .flat_map(|(pixel, (a, b))| {
            if pair.counts.as_ref().is_none_or(|c| c[pixel]) {
                colours[(0..3).map(|c| usize::from(a[c].abs_diff(b[c]))).sum::<usize>()]
            } else {
                [128; 3]
            }
        })
        .collect()
}
