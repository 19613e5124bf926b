//! Figures that show whether a sparse reconstruction can be trusted. A good mean reprojection error does
//! not: collapsed cameras and points behind cameras leave it as it is.

use super::frame::median;
use super::source::{Source, first_names};
use crate::Report;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Fewer observed points than this make a pose doubtful.
const MIN_OBSERVATIONS: usize = 50;

/// Cameras closer than this count as one, in units of the cameras' extent.
const COINCIDENT: f64 = 1e-4;

/// Cameras more than this many median distances from the median centre are outliers.
const FAR_OFF: f64 = 10.0;

/// Depths below this share of the view's median depth count as zero.
const ZERO_DEPTH: f64 = 1e-3;

/// Above this mean error, poses or intrinsics are too far off for training to make up for it.
const MAX_REPROJECTION_ERROR_PX: f64 = 1.5;

/// How plausible a sparse reconstruction looks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct SparseHealth {
    /// Views with a pose.
    pub registered: usize,
    /// Photos in the photo folder.
    pub present: usize,
    /// Points of the reconstruction.
    pub points: usize,
    /// Observations of points over all views.
    pub observations: usize,
    /// Observations of the view with the fewest.
    pub min_observations_per_view: usize,
    /// Median over the views.
    pub median_observations_per_view: f64,
    /// Views with fewer than 50.
    pub views_under_50_observations: usize,
    /// Views whose camera centre coincides with that of another.
    pub coincident_cameras: usize,
    /// Views more than ten median distances away from the median camera.
    pub cameras_far_off: usize,
    /// Observations whose point lies behind the camera.
    pub observations_behind_camera: usize,
    /// Observations whose point lies in front of the camera, but at almost zero depth.
    pub observations_at_zero_depth: usize,
    /// Mean over the points, where the reconstruction states it.
    pub mean_reprojection_error_px: Option<f64>,
}

/// The photos in the photo folder.
pub(crate) struct PhotosOnDisk {
    /// Number of all.
    pub present: usize,
    /// Number of those with a pose, also of views that were left out.
    pub posed: usize,
}

impl PhotosOnDisk {
    /// Number of photos without a pose.
    pub fn without_pose(&self) -> usize {
        self.present.saturating_sub(self.posed)
    }

    /// Warns of these.
    pub fn warn(&self, report: &mut Report) {
        let missing = self.without_pose();
        if missing > 0 {
            let what = format!("{missing} of {} photos have no pose and are not used", self.present);
            report.warn("photos-not-registered", missing, what);
        }
    }
}

/// Measures a sparse reconstruction and warns of what looks wrong; `extent` is that of the capture, in its
/// units, `num_photos` the number of photos in the photo folder.
pub(crate) fn check(source: &Source, extent: f64, num_photos: usize, report: &mut Report) -> SparseHealth {
    let counts: Vec<usize> = source.views.iter().map(|v| v.observed.len()).collect();
    let (behind, at_zero) = misplaced(source);
    let health = SparseHealth {
        registered: source.views.len(),
        present: num_photos,
        points: source.points.len(),
        observations: counts.iter().sum(),
        min_observations_per_view: counts.iter().copied().min().unwrap_or(0),
        median_observations_per_view: median(counts.iter().map(|&c| c as f64).collect()).unwrap_or(0.0),
        views_under_50_observations: counts.iter().filter(|&&c| c < MIN_OBSERVATIONS).count(),
        coincident_cameras: coincident(source, COINCIDENT * extent).len(),
        cameras_far_off: far_off(source).len(),
        observations_behind_camera: behind,
        observations_at_zero_depth: at_zero,
        mean_reprojection_error_px: source.reprojection_error_px,
    };
    warn(source, &health, extent, report);
    health
}

fn warn(source: &Source, health: &SparseHealth, extent: f64, report: &mut Report) {
    const HINT: &str = "a model with a good mean reprojection error can still be broken";
    if health.observations > 0 && health.views_under_50_observations > 0 {
        let weak = source.views.iter().filter(|v| v.observed.len() < MIN_OBSERVATIONS);
        let what = format!(
            "{} of {} views observe fewer than {MIN_OBSERVATIONS} points, so their poses are unreliable: {}; {HINT}",
            health.views_under_50_observations,
            health.registered,
            first_names(weak.map(|v| v.name.as_str()))
        );
        report.warn("views-with-few-observations", health.views_under_50_observations, what);
    }
    if health.coincident_cameras > 0 {
        let names = coincident(source, COINCIDENT * extent);
        let what = format!(
            "{} camera centres coincide with another: {}; taken from one spot, or collapsed: {HINT}",
            names.len(),
            first_names(names)
        );
        report.warn("coincident-cameras", health.coincident_cameras, what);
    }
    if health.cameras_far_off > 0 {
        let what = format!(
            "{} cameras are more than {FAR_OFF} median distances away: {}; they set the scale of the capture; \
             {HINT}",
            health.cameras_far_off,
            first_names(far_off(source))
        );
        report.warn("cameras-far-off", health.cameras_far_off, what);
    }
    let misplaced = health.observations_behind_camera + health.observations_at_zero_depth;
    if misplaced > 0 {
        let what = format!(
            "{} of {} observed points lie behind the observing camera, {} at almost zero depth; {HINT}",
            health.observations_behind_camera, health.observations, health.observations_at_zero_depth
        );
        report.warn("points-behind-cameras", misplaced, what);
    }
    if let Some(error) = health.mean_reprojection_error_px.filter(|e| *e > MAX_REPROJECTION_ERROR_PX) {
        let what = format!(
            "the mean reprojection error is {error:.2} px; good reconstructions are below 1: register the photos again"
        );
        report.warn("large-reprojection-error", 1, what);
    }
}

/// Numbers of observations behind the camera and at almost zero depth.
fn misplaced(source: &Source) -> (usize, usize) {
    let (mut behind, mut at_zero) = (0, 0);
    for view in &source.views {
        let depths: Vec<f64> = view
            .observed
            .iter()
            .map(|&i| source.points[i as usize].position_in_capture)
            .map(|p| view.camera_from_capture.transform_point(p).z)
            .collect();
        behind += depths.iter().filter(|z| **z <= 0.0).count();
        let positive: Vec<f64> = depths.into_iter().filter(|z| *z > 0.0).collect();
        if let Some(median) = median(positive.clone()) {
            at_zero += positive.iter().filter(|z| **z < ZERO_DEPTH * median).count();
        }
    }
    (behind, at_zero)
}

/// Names of views far away from all others.
fn far_off(source: &Source) -> Vec<&str> {
    let centres: Vec<DVec3> = source.views.iter().map(|v| v.camera_from_capture.origin_of_a_in_b()).collect();
    let along = |axis: usize| median(centres.iter().map(|c| c[axis]).collect()).unwrap_or(0.0);
    let middle = DVec3::new(along(0), along(1), along(2));
    let distances: Vec<f64> = centres.iter().map(|c| c.distance(middle)).collect();
    let limit = FAR_OFF * median(distances.clone()).unwrap_or(0.0);
    let far = source.views.iter().zip(distances).filter(|(_, d)| *d > limit);
    far.map(|(v, _)| v.name.as_str()).collect()
}

/// Names of views with another camera within `distance`.
fn coincident(source: &Source, distance: f64) -> Vec<&str> {
    let mut centres: Vec<_> =
        source.views.iter().map(|v| (v.camera_from_capture.origin_of_a_in_b(), v.name.as_str())).collect();
    // Sorted along x only close neighbours need to be compared.
    centres.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
    let mut is_coincident = vec![false; centres.len()];
    for first in 0..centres.len() {
        for second in first + 1..centres.len() {
            if centres[second].0.x - centres[first].0.x > distance {
                break;
            }
            if centres[second].0.distance(centres[first].0) <= distance {
                is_coincident[first] = true;
                is_coincident[second] = true;
            }
        }
    }
    let mut names: Vec<&str> =
        centres.iter().zip(is_coincident).filter(|(_, is)| *is).map(|(c, _)| c.1).collect();
    names.sort_unstable();
    names
}
