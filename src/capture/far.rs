//! Cameras and points so far from all others that they are faults of the reconstruction. One such camera would set the extent
//! of the capture, and with it the scale of everything.

use super::frame::median;
use super::source::{Source, UnusedView, Why, first_names};
use crate::Report;
use glam::DVec3;

/// Median distances from the median beyond which a camera or a point is left out. Measured: 2.5 is the most for a camera of
/// four real captures, 14 for a point.
const FAR: f64 = 20.0;

/// At most one of four may be far: more are a second place where photos were taken, not a fault. Measured: of two real
/// captures with a quarter of the cameras thrown 100 median distances away, the median distance grows by 15 %, so all of
/// these are found (20 draws each); with 45 %, by 71 %. So the rule would find more: the number says what a fault is.
const ONE_IN: usize = 4;

/// The spread of places that differ by rounding only, in units of their distance from the origin.
const ROUNDING: f64 = 1e-9;

/// Leaves out far cameras and points, each compared with its like.
pub(crate) fn leave_out(source: &mut Source, report: &mut Report) {
    let centres: Vec<DVec3> = source.views.iter().map(|v| v.camera_from_capture.origin_of_a_in_b()).collect();
    if let Some(limit) = Limit::of(&centres) {
        let total = source.views.len();
        let mut keeps = centres.iter().map(|&centre| limit.keeps(centre));
        let (near, far) =
            std::mem::take(&mut source.views).into_iter().partition(|_| keeps.next() == Some(true));
        source.views = near;
        let far: Vec<_> = far;
        let names = first_names(far.iter().map(|v| v.name.as_str()));
        let what = format!(
            "{} of {total} cameras {} more than {FAR} median distances from the median and left out: {names}; \
             --set capture.keep-far=true (inspect: --keep-far) keeps them",
            far.len(),
            are(far.len())
        );
        report.warn("far-cameras", far.len(), what);
        source.unused.extend(far.into_iter().map(|v| UnusedView {
            name: v.name,
            why: Why::Far,
            split: v.split,
        }));
    }
    let positions: Vec<DVec3> = source.points.iter().map(|p| p.position_in_capture).collect();
    if let Some(limit) = Limit::of(&positions) {
        let total = positions.len();
        source.retain_points(|point| limit.keeps(point.position_in_capture));
        let count = total - source.points.len();
        let what = format!(
            "{count} of {total} points {} more than {FAR} median distances from the median and left out; \
             --set capture.keep-far=true (inspect: --keep-far) keeps them",
            are(count)
        );
        report.warn("far-points", count, what);
    }
}

fn are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

/// A ball around the median.
struct Limit {
    middle: DVec3,
    radius: f64,
}

impl Limit {
    /// The ball outside which places are far; `None` if none is, or too many to be faults.
    fn of(places: &[DVec3]) -> Option<Self> {
        let along = |axis: usize| median(places.iter().map(|p| p[axis]).collect());
        let middle = DVec3::new(along(0)?, along(1)?, along(2)?);
        let spread = median(places.iter().map(|p| p.distance(middle)).collect())?;
        // Photos from one spot: no distance tells anything.
        if spread <= ROUNDING * (1.0 + middle.length()) {
            return None;
        }
        let limit = Self { middle, radius: FAR * spread };
        let far = places.iter().filter(|p| !limit.keeps(**p)).count();
        (far > 0 && far * ONE_IN <= places.len()).then_some(limit)
    }

    fn keeps(&self, place: DVec3) -> bool {
        place.distance(self.middle) <= self.radius
    }
}
