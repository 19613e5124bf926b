//! The local frame of training (cameras centred on the origin, extent of the capture 1) and its near plane.

use super::source::Source;
use crate::Report;
use crate::camera::{Similarity, mean_and_reach};
use crate::constants::{EXTENT_MARGIN, NEAR_MAX};
use glam::DVec3;

/// Near plane over the quantile of the points' depths; a few points may lie closer.
const NEAR_SHARE: f64 = 0.5;
const NEAR_QUANTILE: f64 = 0.01;

/// Closest near plane, local units: a few broken points must not move it to the lens.
const NEAR_MIN: f64 = 1e-3;

/// Median; `None` of no values.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    quantile(&mut values, 0.5)
}

/// Value below which a share of the values lies; NaN sorts last.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let rank = (share * (values.len() - 1) as f64).round() as usize;
    Some(*values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

/// The move and scale that centre the cameras on the origin and make the extent of the capture 1.
pub(crate) fn capture_from_local(source: &Source, report: &mut Report) -> Similarity {
    let mut centres: Vec<DVec3> =
        source.views.iter().map(|v| v.camera_from_capture.origin_of_a_in_b()).collect();
    // The sum must not depend on the order of the views, not even in its last bit.
    centres.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    let (translation, farthest) = mean_and_reach(&centres);
    // Not merely rounding, which grows with the distance from the capture's origin.
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
    let what = format!(
        "all {} cameras are in one place; the scale of the capture is taken from {}; such photos cannot \
         teach depth",
        centres.len(),
        if points.is_some() { "the median distance of the points" } else { "its own units" }
    );
    report.warn("all-cameras-coincide", centres.len(), what);
    Similarity { scale: points.unwrap_or(1.0), translation }
}

/// Near plane in local units: half the 1 % quantile of the points' depths, bounded.
pub(crate) fn near(source: &Source, scale: f64) -> f32 {
    let mut depths = depths(source);
    let quantile = quantile(&mut depths, NEAR_QUANTILE);
    let near = quantile.map_or(NEAR_MAX, |q| NEAR_SHARE * q / scale);
    near.clamp(NEAR_MIN, NEAR_MAX) as f32
}

/// Positive depths of points over the views, in capture units: of observed points where observations are
/// known, otherwise of all points that project into a view.
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
