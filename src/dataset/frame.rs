//! The local frame in which training happens: cameras around the origin, their extent 1, and the near
//! plane that goes with it.

use super::source::Source;
use crate::Report;
use crate::camera::Similarity;
use crate::constants::NEAR_MAX;
use glam::DVec3;

/// Extent = this times the largest distance of a camera from their mean (3DGS).
const EXTENT_MARGIN: f64 = 1.1;

/// Near plane = this times the quantile of the depths, which points in front of it may undercut.
const NEAR_SHARE: f64 = 0.5;
const NEAR_QUANTILE: f64 = 0.01;

/// No near plane closer than this, local units: a few broken points must not bring it to the lens.
const NEAR_MIN: f64 = 1e-3;

/// Median; `None` if there is nothing.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    quantile(&mut values, 0.5)
}

/// Value below which the given share of the values lies; NaN sort last.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let rank = (share * (values.len() - 1) as f64).round() as usize;
    Some(*values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

/// Moves and scales the capture so that the cameras' extent is 1 around their mean.
pub(crate) fn capture_from_local(source: &Source, report: &mut Report) -> Similarity {
    let mut centres: Vec<DVec3> =
        source.views.iter().map(|v| v.camera_from_capture.origin_of_a_in_b()).collect();
    // The sum must not depend on the order of the views, not even in its last bit.
    centres.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    let translation = centres.iter().sum::<DVec3>() / centres.len().max(1) as f64;
    let farthest = centres.iter().map(|c| c.distance(translation)).fold(0.0, f64::max);
    // Rounding of poses far from the capture's origin is no extent.
    if farthest > 1e-9 * (1.0 + translation.length()) {
        return Similarity { scale: EXTENT_MARGIN * farthest, translation };
    }
    let distances = source
        .points
        .iter()
        .map(|p| p.position_in_capture.distance(translation))
        .filter(|d| d.is_finite() && *d > 0.0)
        .collect();
    let points = median(distances);
    report.warn(
        "cameras-coincide",
        centres.len(),
        format!(
            "all {} cameras stand in one place; the scale of the capture is taken from {}; depth cannot be \
             learned from such photos",
            centres.len(),
            if points.is_some() { "the median distance of the points" } else { "its own units" }
        ),
    );
    Similarity { scale: points.unwrap_or(1.0), translation }
}

/// Near plane in local units: half the 1 % quantile of the points' depths, bounded.
pub(crate) fn near(source: &Source, scale: f64) -> f32 {
    let mut depths = depths(source);
    let quantile = quantile(&mut depths, NEAR_QUANTILE);
    let near = quantile.map_or(NEAR_MAX, |q| NEAR_SHARE * q / scale);
    near.clamp(NEAR_MIN, NEAR_MAX) as f32
}

/// Positive depths of points over the views, capture units: of observed points where observations are
/// known, else of all points that a view shows.
fn depths(source: &Source) -> Vec<f64> {
    let observed = source.views.iter().any(|v| !v.observed.is_empty());
    let mut depths = Vec::new();
    for view in &source.views {
        let mut add = |position: DVec3| {
            let in_camera = view.camera_from_capture.transform_point(position);
            let shown = observed
                || view.lens.pinhole.project(in_camera).is_some_and(|p| {
                    let c = &view.lens.pinhole;
                    p.x >= 0.0 && p.y >= 0.0 && p.x <= c.width_px.into() && p.y <= c.height_px.into()
                });
            if shown && in_camera.z.is_finite() && in_camera.z > 0.0 {
                depths.push(in_camera.z);
            }
        };
        if observed {
            let points = view.observed.iter().map(|&i| &source.points[i as usize]);
            points.for_each(|p| add(p.position_in_capture));
        } else {
            source.points.iter().for_each(|p| add(p.position_in_capture));
        }
    }
    depths
}
