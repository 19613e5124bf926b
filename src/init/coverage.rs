//! Sizes and opacities of initial splats: half the spacing and opaque, except those that rays of the training views need at
//! full size (method 5.5).

use super::cells::{coarse, visit_cells};
use super::input::InitInput;
use super::points::LocalPoint;
use rayon::prelude::*;

/// Standard deviation over the spacing, and opacity, of splats that are not needed as large as the spacing. Measured:
/// lab/choices.md, 22. With opacity 0.1, small splats leave 1.7 % more pixels uncovered.
const FACTOR: f32 = 0.5;
const OPACITY: f64 = 0.5;

/// Opacity of those that keep the spacing. They hide what stands near them if they are as opaque as the others (0.5: bonsai at
/// 240 pixels -0.3 dB).
const NEEDED_OPACITY: f64 = 0.2;

/// Depth of the splats on a ray that is enough: they hide a third of what is behind. At 0.7, with opacities of 0.1 and 0.3,
/// gradient-PSNR is 0.08 and 0.02 dB lower; 0.2 is as good within 0.03 dB (four captures at 240 pixels).
const DEPTH_ENOUGH: f64 = 0.4;

/// Rays along the longer side of a view. Not measured.
const RAYS_PER_SIDE: u32 = 48;

/// Splats count up to three standard deviations from their centre, and cover what lies within two. Not measured.
const SEEN_SIGMA: f64 = 3.0;
const COVERED_SIGMA: f64 = 2.0;

/// Makes splats that were sized by spacing smaller and more opaque, except those that a ray needs at full size.
pub(super) fn size_by_coverage(points: &mut [LocalPoint], input: &InitInput<'_>) {
    let none = || vec![false; points.len()];
    let or = |mut a: Vec<bool>, b: Vec<bool>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a |= b);
        a
    };
    let views = input.photo_views();
    let of_view = |needed, &view: &usize| or(needed, needed_by(input, view, points));
    let needed = views.par_iter().fold(none, of_view).reduce(none, or);
    for (point, needed) in points.iter_mut().zip(needed) {
        (point.sigma, point.opacity) =
            if needed { (point.sigma, NEEDED_OPACITY) } else { (FACTOR * point.sigma, OPACITY) };
    }
}

/// Which splats a view needs as large as they are.
fn needed_by(input: &InitInput<'_>, view: usize, points: &[LocalPoint]) -> Vec<bool> {
    let camera = coarse(&input.views.camera(view), RAYS_PER_SIDE);
    let mut depths = vec![[0.0; 2]; camera.pinhole.num_pixels()];
    visit_cells(&camera, input.near, points, (SEEN_SIGMA, 0.0), |splat, cell, squared| {
        let [spaced, small] = &mut depths[cell];
        *spaced += points[splat].opacity * (-0.5 * squared).exp();
        let squared = squared / f64::from(FACTOR * FACTOR);
        if squared <= SEEN_SIGMA * SEEN_SIGMA {
            *small += OPACITY * (-0.5 * squared).exp();
        }
    });
    let mut needed = vec![false; points.len()];
    // A splat between rays stands for the nearest ones.
    visit_cells(&camera, input.near, points, (COVERED_SIGMA, 1.0), |splat, cell, _| {
        let [spaced, small] = depths[cell];
        needed[splat] |= small < spaced.min(DEPTH_ENOUGH);
    });
    needed
}
