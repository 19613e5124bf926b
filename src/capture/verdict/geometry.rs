//! How the cameras of a capture stand to its points and to each other.

use crate::camera::Camera;
use crate::capture::frame::median;
use crate::capture::loaded::Capture;
use crate::views::ViewSource as _;
use glam::DVec3;

/// Of more points, as many evenly spaced ones stand for all.
const POINTS_MAX: usize = 4096;

/// Cameras closer than this stand in one place, in units of the median depth of the points.
const SAME_PLACE: f64 = 1e-3;

/// The same in local units, where no points are known.
const SAME_PLACE_LOCAL: f64 = 1e-4;

/// How the cameras stand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Geometry {
    /// Places that cameras stand in.
    pub places: usize,
    /// Mean number of views that a point was triangulated from, weighted by views; `None` where that is not known.
    pub views_per_point: Option<f64>,
    /// Median angle over the points between the two rays to it that differ most, degrees.
    pub parallax_degrees: Option<f64>,
}

/// Measures a capture.
pub(super) fn of(capture: &Capture) -> Geometry {
    let cameras: Vec<Camera> = (0..capture.num_views()).map(|view| capture.camera(view)).collect();
    let centres: Vec<DVec3> = cameras.iter().map(Camera::centre_in_local).collect();
    let local_from_capture = capture.capture_from_local.inverse();
    let step = capture.points.len().div_ceil(POINTS_MAX).max(1);
    let points: Vec<DVec3> = capture
        .points
        .iter()
        .step_by(step)
        .map(|point| local_from_capture.transform_point(point.position_in_capture))
        .collect();
    let seen_by = seen_by(capture, &cameras, &points, step);
    let depths = seen_by
        .iter()
        .zip(&points)
        .flat_map(|(views, point)| views.iter().map(|&v| centres[v].distance(*point)));
    let distance = median(depths.collect()).map_or(SAME_PLACE_LOCAL, |depth| SAME_PLACE * depth);
    let has_tracks = capture.observed.iter().any(|points| !points.is_empty());
    let parallax = seen_by.iter().zip(&points).filter(|(views, _)| views.len() > 1);
    Geometry {
        places: places(&centres, distance),
        views_per_point: has_tracks.then(|| mean_of_observations(&seen_by)).flatten(),
        parallax_degrees: median(parallax.map(|(views, &point)| widest(&centres, views, point)).collect()),
    }
}

/// The views of each point: those it was triangulated from or, where that is not known, that it lies within.
fn seen_by(capture: &Capture, cameras: &[Camera], points: &[DVec3], step: usize) -> Vec<Vec<usize>> {
    if capture.observed.iter().all(|points| points.is_empty()) {
        let of = |point: &DVec3| (0..cameras.len()).filter(|&view| cameras[view].shows(*point)).collect();
        return points.iter().map(of).collect();
    }
    let mut seen_by = vec![Vec::new(); points.len()];
    for (view, observed) in capture.observed.iter().enumerate() {
        for index in observed.iter().map(|&index| index as usize).filter(|index| index % step == 0) {
            let views: &mut Vec<usize> = &mut seen_by[index / step];
            if views.last() != Some(&view) {
                views.push(view);
            }
        }
    }
    seen_by
}

/// Over all observations, the mean number of views of the point.
fn mean_of_observations(seen_by: &[Vec<usize>]) -> Option<f64> {
    let count: usize = seen_by.iter().map(Vec::len).sum();
    let squares: usize = seen_by.iter().map(|views| views.len() * views.len()).sum();
    (count > 0).then(|| squares as f64 / count as f64)
}

/// The largest angle between two rays from a point to the cameras of its views, degrees: to the ray that differs most from
/// the first, and from that on again.
fn widest(centres: &[DVec3], views: &[usize], point: DVec3) -> f64 {
    let ray = |view: usize| (centres[view] - point).normalize_or_zero();
    let angle = |a: DVec3, b: DVec3| a.cross(b).length().atan2(a.dot(b)).to_degrees();
    let farthest = |from: DVec3| {
        views
            .iter()
            .map(|&view| ray(view))
            .max_by(|a, b| angle(from, *a).total_cmp(&angle(from, *b)))
            .unwrap_or(from)
    };
    let end = farthest(ray(views[0]));
    angle(end, farthest(end))
}

/// Number of places: cameras within `distance` of one already counted are in the same.
fn places(centres: &[DVec3], distance: f64) -> usize {
    let mut sorted = centres.to_vec();
    // Sorted along x only close neighbours need to be compared.
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x));
    let mut places: Vec<DVec3> = Vec::new();
    for centre in sorted {
        let near = places.iter().rev().take_while(|place| centre.x - place.x <= distance);
        if !near.into_iter().any(|place| place.distance(centre) <= distance) {
            places.push(centre);
        }
    }
    places.len()
}
