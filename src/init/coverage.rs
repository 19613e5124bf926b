//! Sizes of the splats at the start by what they have to cover: half the spacing where enough of them remain, the spacing
//! where rays of the training views would else pass fewer (method 5.5).

use super::footprint::{coarse, visit_cells};
use super::input::InitInput;
use super::points::LocalPoint;
use rayon::prelude::*;

/// Standard deviation over the spacing, and opacity, where enough splats remain.
const FACTOR: f32 = 0.5;
const OPACITY: f64 = 0.5;

/// Opacity of those that keep the spacing. They hide what stands near them if they are as opaque as the others (bonsai at 240
/// pixels: -0.3 dB).
const NEEDED_OPACITY: f64 = 0.2;

/// Optical depth of the splats on a ray that is enough: they hide a third of what is behind. At 0.7 more splats keep the spacing, which
/// costs 0.05 dB of gradient-PSNR (four captures at 240 pixels, 2 to 4 seeds); at 0.2 as good, but 1 % more of bonsai stays uncovered.
const DEPTH_ENOUGH: f64 = 0.4;

/// Rays along the longer side of a view.
const RAYS_PER_SIDE: u32 = 48;

/// Splats count up to three standard deviations from their centre, and cover what lies within two.
const SEEN_SIGMA: f64 = 3.0;
const COVERED_SIGMA: f64 = 2.0;

/// Makes splats that were sized by spacing smaller and more opaque, but for those without which a ray would be covered less.
pub(super) fn shrink(points: &mut [LocalPoint], input: &InitInput<'_>) {
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
    let depths = |factor: f32, opacity: Option<f64>| {
        let mut depths = vec![0.0; camera.pinhole.num_pixels()];
        let sized = points.iter().map(|point| LocalPoint { sigma: factor * point.sigma, ..*point });
        visit_cells(&camera, input.near, sized.enumerate(), (SEEN_SIGMA, 0.0), |splat, cell, squared| {
            depths[cell] += opacity.unwrap_or(points[splat].opacity) * (-0.5 * squared).exp();
        });
        depths
    };
    let (before, after) = (depths(1.0, None), depths(FACTOR, Some(OPACITY)));
    let lacks: Vec<bool> =
        before.iter().zip(&after).map(|(before, after)| *after < before.min(DEPTH_ENOUGH)).collect();
    let mut needed = vec![false; points.len()];
    // A splat between rays stands for the nearest ones.
    visit_cells(
        &camera,
        input.near,
        points.iter().copied().enumerate(),
        (COVERED_SIGMA, 1.0),
        |splat, cell, _| {
            needed[splat] |= lacks[cell];
        },
    );
    needed
}
