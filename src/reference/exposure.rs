//! Correction of a rendered image by the exposure of its photo, and its adjoint (method 3.1).

use super::loss::colour;
use crate::backend::{ColourMap, ColourSums, TargetImage};

/// The image as the photo's exposure shows it, and the sums from which that exposure is estimated.
/// `rgb` is `[height, width, 3]`.
pub fn exposure_fwd(
    rgb: &[f64],
    target: &TargetImage,
    background: [f64; 3],
    map: &ColourMap,
) -> (Vec<f64>, ColourSums) {
    let mut sums = ColourSums::default();
    let mut out = Vec::with_capacity(rgb.len());
    for (pixel, x) in rgb.as_chunks::<3>().0.iter().enumerate() {
        if target.counts(pixel) {
            sums.add(*x, colour(target, pixel, background));
        }
        let row = |m: [f32; 4]| m.map(f64::from);
        out.extend(map.0.map(row).map(|m| m[0] * x[0] + m[1] * x[1] + m[2] * x[2] + m[3]));
    }
    (out, sums)
}

/// The derivative with respect to the rendered image, from that with respect to the corrected one. `[height, width, 3]`
pub fn exposure_bwd(gradient: &[f64], map: &ColourMap) -> Vec<f64> {
    let column = |c: usize| map.0.map(|row| f64::from(row[c]));
    let back = |g: &[f64; 3]| [0, 1, 2].map(|c| column(c).iter().zip(g).map(|(m, g)| m * g).sum::<f64>());
    gradient.as_chunks::<3>().0.iter().flat_map(back).collect()
}
