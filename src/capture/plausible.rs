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

/// Photos may be this many times smaller than their camera says; reduced copies are 2 to 8 times smaller.
const MAX_REDUCTION: f64 = 32.0;

/// Sides below the window of SSIM say little.
const MIN_SIDE_PX: u32 = 2 * SSIM_RADIUS_PX as u32 + 1;

/// Focal lengths within are written out in messages, others in scientific notation.
const WRITTEN_OUT_PX: std::ops::Range<f64> = 1e-3..1e7;

/// Warns of implausible focal lengths, principal points and sizes.
pub(crate) fn check(views: &[SourceView], recipes: &[Recipe], report: &mut Report) {
    let pairs = || views.iter().zip(recipes);
    let mut warn = |code: &str, what: &str, found: Vec<&SourceView>| {
        if let Some(first) = found.first() {
            let p = &first.lens.pinhole;
            let what = format!(
                "{} of {} views have {what}: {} (the first: focal lengths {} and {} px, principal \
                 point {}, {}, {} x {} px); check the units of their cameras and whether the photos belong to them",
                found.len(),
                views.len(),
                first_names(found.iter().map(|v| v.name.as_str())),
                written(p.fx_px),
                written(p.fy_px),
                written(p.cx_px),
                written(p.cy_px),
                p.width_px,
                p.height_px
            );
            report.warn(code, found.len(), what);
        }
    };
    let absurd = views.iter().filter(|v| !has_plausible_focal_length(v)).collect();
    warn("implausible-focal-lengths", "an implausible focal length", absurd);
    let far_off = views.iter().filter(|v| !has_plausible_principal_point(v)).collect();
    let what = "a principal point further outside the image than the image is large";
    warn("implausible-principal-points", what, far_off);
    let reduced = pairs().filter(|(view, recipe)| {
        f64::from(view.lens.pinhole.width_px) > MAX_REDUCTION * f64::from(recipe.photo_size.0)
    });
    let what = format!("photos more than {MAX_REDUCTION} times smaller than their camera");
    warn("photos-far-smaller-than-cameras", &what, reduced.map(|(view, _)| view).collect());
    let tiny = pairs().filter(|(_, recipe)| recipe.size.0.min(recipe.size.1) < MIN_SIDE_PX);
    let what = format!("a side of fewer than {MIN_SIDE_PX} pixels as trained");
    warn("views-too-small", &what, tiny.map(|(view, _)| view).collect());
}

/// Crops and lenses with shift have it beside the image, but not by more than its size.
fn has_plausible_principal_point(view: &SourceView) -> bool {
    let p = &view.lens.pinhole;
    [(p.cx_px, p.width_px), (p.cy_px, p.height_px)].iter().all(|&(centre_px, side_px)| {
        let side_px = f64::from(side_px);
        (-side_px..=2.0 * side_px).contains(&centre_px)
    })
}

fn written(px: f64) -> String {
    if px == 0.0 || WRITTEN_OUT_PX.contains(&px.abs()) { px.to_string() } else { format!("{px:e}") }
}

fn has_plausible_focal_length(view: &SourceView) -> bool {
    let p = &view.lens.pinhole;
    let longer = f64::from(p.width_px.max(p.height_px));
    let aspect = p.fx_px / p.fy_px;
    (1.0 / MAX_PIXEL_ASPECT..=MAX_PIXEL_ASPECT).contains(&aspect)
        && [p.fx_px, p.fy_px].iter().all(|f| (FOCAL_BOUNDS.0..=FOCAL_BOUNDS.1).contains(&(f / longer)))
}
