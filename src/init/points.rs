//! Initial positions of splats: points moved into the local frame or drawn at random, then filtered, thinned and
//! sorted.

use super::input::InitInput;
use super::random::{Purpose, Stream, points_in_views};
use crate::Report;
use crate::train::density::morton_codes;
use crate::views::{SfmPoint, ViewSource};
use glam::DVec3;
use std::collections::HashSet;

/// Points closer to a camera than this, in local units, give tiny splats and NaN
/// (graphdeco-inria/gaussian-splatting 41).
const CLEARANCE: f64 = 0.01;

/// A point of the local frame that becomes a splat.
#[derive(Clone, Copy)]
pub(super) struct LocalPoint {
    pub position: [f32; 3],
    /// Display space, 0 to 1.
    pub rgb: [f32; 3],
    /// Squared distance from the cameras' mean.
    pub distance: f64,
    /// local_from_surfel, wxyz.
    pub quaternion: [f32; 4],
    /// Standard deviation along both axes, local units.
    pub sigma: f32,
    pub opacity: f64,
}

impl LocalPoint {
    pub fn new(in_local: DVec3, rgb: [f32; 3]) -> Self {
        Self {
            position: in_local.as_vec3().to_array(),
            rgb,
            distance: in_local.length_squared(),
            quaternion: [1.0, 0.0, 0.0, 0.0],
            sigma: 0.0,
            opacity: 0.0,
        }
    }

    pub fn position_in_local(&self) -> DVec3 {
        DVec3::from_array(self.position.map(f64::from))
    }
}

/// The value that a share of the values do not exceed; there must be one.
pub(super) fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = (share * (values.len() - 1) as f64) as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// The points of the capture, in the local frame.
pub(super) fn local_points(input: &InitInput<'_>, points: &[SfmPoint]) -> Vec<LocalPoint> {
    let local_from_capture = input.capture_from_local.inverse();
    points
        .iter()
        .map(|p| {
            let in_local = local_from_capture.transform_point(p.position_in_capture);
            LocalPoint::new(in_local, p.rgb.map(|c| f32::from(c) / 255.0))
        })
        .collect()
}

/// Random points in the views, of almost the same grey.
pub(super) fn random_points(input: &InitInput<'_>, count: usize, seed: u64) -> Vec<LocalPoint> {
    let mut stream = Stream::new(seed, Purpose::Colours);
    points_in_views(input.views, count, &mut Stream::new(seed, Purpose::Positions))
        .into_iter()
        // Grey with a little variation, so that equal splats do not stay equal.
        .map(|p| LocalPoint::new(p, [0; 3].map(|_| (0.4 + 0.2 * stream.uniform()) as f32)))
        .collect()
}

/// Leaves out points that cannot become splats.
pub(super) fn usable(
    points: Vec<LocalPoint>,
    views: &dyn ViewSource,
    report: &mut Report,
) -> Vec<LocalPoint> {
    let centres: Vec<DVec3> = (0..views.num_views()).map(|v| views.camera(v).centre_in_local()).collect();
    let (mut not_finite, mut at_camera, mut duplicates) = (0, 0, 0);
    let mut known = HashSet::new();
    let total = points.len();
    let kept: Vec<LocalPoint> = points
        .into_iter()
        .filter(|point| {
            let position = point.position_in_local();
            if !position.is_finite() {
                not_finite += 1;
                return false;
            }
            if centres.iter().any(|c| c.distance_squared(position) < CLEARANCE * CLEARANCE) {
                at_camera += 1;
                return false;
            }
            // + 0.0 makes -0.0 equal to 0.0.
            let is_new = known.insert(point.position.map(|v| (v + 0.0).to_bits()));
            duplicates += usize::from(!is_new);
            is_new
        })
        .collect();
    for (code, count, what) in [
        ("points-not-finite", not_finite, "are not finite"),
        ("points-at-camera", at_camera, "are closer to a camera than 1 % of the capture's extent"),
        ("points-duplicate", duplicates, "coincide with another point"),
    ] {
        if count > 0 {
            report.warn(code, count, format!("{count} of {total} points {what} and are left out"));
        }
    }
    kept
}

/// At most as many points as allowed, chosen at random, in their order.
pub(super) fn thinned(
    points: Vec<LocalPoint>,
    max_points: usize,
    seed: u64,
    report: &mut Report,
) -> Vec<LocalPoint> {
    let total = points.len();
    if total <= max_points {
        return points;
    }
    let mut stream = Stream::new(seed, Purpose::Thinning);
    let mut order: Vec<usize> = (0..total).collect();
    for chosen in 0..max_points {
        order.swap(chosen, chosen + stream.index(total - chosen));
    }
    order.truncate(max_points);
    order.sort_unstable();
    let what = format!("{} of {total} points kept, chosen at random", order.len());
    report.warn("points-thinned", total - order.len(), what);
    order.into_iter().map(|i| points[i]).collect()
}

/// In the order in which density control stores splats: neighbours in space are neighbours in memory.
pub(super) fn along_a_curve(points: &[LocalPoint]) -> Vec<LocalPoint> {
    let positions: Vec<f32> = points.iter().flat_map(|point| point.position).collect();
    let mut order: Vec<(u64, usize)> = morton_codes(&positions).into_iter().zip(0..).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| points[i]).collect()
}
