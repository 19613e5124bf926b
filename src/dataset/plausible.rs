//! Warns of cameras and sizes that are valid but implausible, naming the views: the usual cause is a wrong unit or a
//! photo of another capture.

use super::decode::Recipe;
use super::source::{SourceView, first_names};
use crate::Report;
use crate::constants::SSIM_RADIUS_PX;

/// Focal lengths over the longer side: from a field of view of 157 degrees to one of 2 degrees.
const FOCAL_BOUNDS: (f64, f64) = (0.1, 30.0);

/// Largest ratio of the focal lengths along x and y, or its inverse: pixels are almost square.
const MAX_PIXEL_ASPECT: f64 = 2.0;

/// Photos may be so many times smaller than their camera says; reduced copies are 2 to 8 times smaller.
const MAX_REDUCTION: f64 = 32.0;

/// Sides below the window of SSIM say little.
const MIN_SIDE_PX: u32 = 2 * SSIM_RADIUS_PX as u32 + 1;

/// Warns of implausible focal lengths and sizes.
pub(crate) fn check(views: &[SourceView], recipes: &[Recipe], report: &mut Report) {
    let pairs = || views.iter().zip(recipes);
    let mut warn = |code: &str, what: &str, found: Vec<&SourceView>| {
        if let Some(first) = found.first() {
            let p = &first.lens.pinhole;
            report.warn(
                code,
                found.len(),
                format!(
                    "{} of {} views have {what}: {} (the first: focal lengths {} and {} px, {} x {} px); check the \
                     units of their cameras and whether the photos belong to them",
                    found.len(),
                    views.len(),
                    first_names(found.iter().map(|v| v.name.as_str())),
                    p.fx_px,
                    p.fy_px,
                    p.width_px,
                    p.height_px
                ),
            );
        }
    };
    let absurd = views.iter().filter(|v| !has_plausible_focal_length(v)).collect();
    warn("implausible-focal-lengths", "an implausible focal length", absurd);
    let reduced = pairs().filter(|(view, recipe)| {
        f64::from(view.lens.pinhole.width_px) > MAX_REDUCTION * f64::from(recipe.photo_size.0)
    });
    let what = format!("photos more than {MAX_REDUCTION} times smaller than their camera");
    warn("photos-far-smaller-than-cameras", &what, reduced.map(|(view, _)| view).collect());
    let tiny = pairs().filter(|(_, recipe)| recipe.size.0.min(recipe.size.1) < MIN_SIDE_PX);
    let what = format!("a side of fewer than {MIN_SIDE_PX} pixels as trained");
    warn("views-too-small", &what, tiny.map(|(view, _)| view).collect());
}

fn has_plausible_focal_length(view: &SourceView) -> bool {
    let p = &view.lens.pinhole;
    let longer = f64::from(p.width_px.max(p.height_px));
    let aspect = p.fx_px / p.fy_px;
    (1.0 / MAX_PIXEL_ASPECT..=MAX_PIXEL_ASPECT).contains(&aspect)
        && [p.fx_px, p.fy_px].iter().all(|f| (FOCAL_BOUNDS.0..=FOCAL_BOUNDS.1).contains(&(f / longer)))
}
