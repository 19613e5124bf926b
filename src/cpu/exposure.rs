//! Correction of a rendered image by the exposure of its photo, and its adjoint (twin: `reference/exposure.rs`).
//! Planes are `[height, width]` f32.

use crate::backend::{ColourMap, ColourSums, TargetImage};
use rayon::prelude::*;

/// Replaces the image by what the photo's exposure shows; returns the sums from which that exposure is estimated.
pub(super) fn exposure_fwd(
    image: &mut [Vec<f32>; 3],
    (target, background): (&TargetImage, [f32; 3]),
    map: &ColourMap,
) -> ColourSums {
    let of_row = |y: usize, [r, g, b]: [&mut [f32]; 3]| {
        let mut sums = ColourSums::default();
        let first = y * r.len();
        for (x, ((r, g), b)) in r.iter_mut().zip(g).zip(b).enumerate() {
            let rgb = [*r, *g, *b];
            if target.counts(first + x) {
                let photo = target.colour(first + x, background);
                sums.add(rgb.map(f64::from), photo.map(f64::from));
            }
            [*r, *g, *b] = map.apply(rgb);
        }
        sums
    };
    let rows: Vec<ColourSums> = rows(image, target.width_px).map(|(y, row)| of_row(y, row)).collect();
    // In the order of the rows, for any number of threads.
    rows.iter().fold(ColourSums::default(), |mut sum, row| {
        sum.merge(row);
        sum
    })
}

/// Replaces the derivative with respect to the corrected image by that with respect to the rendered one.
pub(super) fn exposure_bwd(gradient: &mut [Vec<f32>; 3], width_px: u32, map: &ColourMap) {
    rows(gradient, width_px).for_each(|(_, [r, g, b])| {
        for ((r, g), b) in r.iter_mut().zip(g).zip(b) {
            [*r, *g, *b] = map.apply_transposed([*r, *g, *b]);
        }
    });
}

/// The rows of three planes, numbered.
fn rows(
    planes: &mut [Vec<f32>; 3],
    width_px: u32,
) -> impl IndexedParallelIterator<Item = (usize, [&mut [f32]; 3])> {
    let [r, g, b] = planes.each_mut().map(|plane| plane.par_chunks_mut(width_px as usize));
    r.zip(g).zip(b).map(|((r, g), b)| [r, g, b]).enumerate()
}
