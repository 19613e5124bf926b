//! Views that share too little with any other to be reconstructed: nothing ties down what they show.

use super::capture::View;
use super::source::first_names;
use crate::Report;
use crate::camera::{Camera, Similarity};
use crate::views::SfmPoint;
use glam::DVec3;
use rayon::prelude::*;

/// Of more points, as many evenly spaced ones stand for all.
const POINTS_MAX: usize = 4096;

/// A view needs another that shows this share of its points.
const SHARED_MIN: f64 = 0.2;

/// Cosine of the angle between optical axes up to which two views show the same side of things: 75 degrees.
const SAME_SIDE_COS: f64 = 0.26;

/// Warns of views that share less than a fifth of their points with each other view.
pub(super) fn check(
    views: &[View],
    points: &[SfmPoint],
    capture_from_local: &Similarity,
    report: &mut Report,
) {
    let alone = alone(views, points, capture_from_local);
    if !alone.is_empty() {
        report.warn(
            "views-without-overlap",
            alone.len(),
            format!(
                "{} of {} views share less than {:.0} % of their points with any other view: {}; what they show stays \
                 vague: take more photos between them and the others",
                alone.len(),
                views.len(),
                100.0 * SHARED_MIN,
                first_names(alone.iter().copied())
            ),
        );
    }
}

fn alone<'a>(views: &'a [View], points: &[SfmPoint], capture_from_local: &Similarity) -> Vec<&'a str> {
    let local_from_capture = capture_from_local.inverse();
    let points: Vec<DVec3> = points
        .iter()
        .step_by(points.len().div_ceil(POINTS_MAX).max(1))
        .map(|point| local_from_capture.transform_point(point.position_in_capture))
        .collect();
    let shown: Vec<Vec<u64>> = views.par_iter().map(|view| shown(&view.camera, &points)).collect();
    let axes: Vec<DVec3> = views.iter().map(|view| view.camera.camera_from_local.rotation.row(2)).collect();
    let is_alone = |view: &usize| {
        let own: u32 = shown[*view].iter().map(|bits| bits.count_ones()).sum();
        let shared = |other: usize| -> u32 {
            shown[*view].iter().zip(&shown[other]).map(|(a, b)| (a & b).count_ones()).sum()
        };
        let others =
            (0..views.len()).filter(|other| other != view && axes[*view].dot(axes[*other]) > SAME_SIDE_COS);
        let most = others.map(shared).max().unwrap_or(0);
        own > 0 && f64::from(most) < SHARED_MIN * f64::from(own)
    };
    let alone: Vec<usize> = (0..views.len()).into_par_iter().filter(is_alone).collect();
    alone.into_iter().map(|view| views[view].name.as_str()).collect()
}

/// A bit for each point: whether it lies within the view.
fn shown(camera: &Camera, points: &[DVec3]) -> Vec<u64> {
    let size = [f64::from(camera.pinhole.width_px), f64::from(camera.pinhole.height_px)];
    let is_shown = |point: &DVec3| {
        let at = camera.pinhole.project(camera.camera_from_local.transform_point(*point));
        at.is_some_and(|at| at.x >= 0.0 && at.y >= 0.0 && at.x <= size[0] && at.y <= size[1])
    };
    let word = |points: &[DVec3]| {
        points.iter().enumerate().fold(0, |bits, (k, point)| bits | u64::from(is_shown(point)) << k)
    };
    points.chunks(64).map(word).collect()
}

#[cfg(test)]
mod tests {
    use crate::dataset::fixtures::Scene;
    use crate::dataset::{Capture, LoadOptions};
    use glam::{DMat3, DQuat, DVec3};

    fn warned(scene: &Scene) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        scene.write(folder.path());
        let capture = Capture::load(folder.path(), &LoadOptions::default()).unwrap();
        let of = |w: &crate::Warning| (w.code == "views-without-overlap").then(|| w.message.clone());
        capture.report.warnings.iter().find_map(of)
    }

    #[test]
    fn a_view_that_looks_at_something_else_is_named() {
        let scene = Scene::ring(12);
        assert_eq!(warned(&scene), None);
        // The camera turns down: it shows points of its own.
        let mut turned = scene.clone();
        let pose = &mut turned.images[4].camera_from_world;
        let rotation = DMat3::from_quat(pose.0);
        let centre = -(rotation.transpose() * pose.1);
        let x = DVec3::Y.cross(rotation.row(2)).normalize();
        let down = DMat3::from_cols(x, DVec3::NEG_Y.cross(x), DVec3::NEG_Y).transpose();
        *pose = (DQuat::from_mat3(&down), -(down * centre));
        for i in 0..20 {
            let p = centre - 5.0 * DVec3::Y + 0.05 * f64::from(i) * x;
            turned.points.push((p.to_array(), [9; 3]));
        }
        let name = turned.images[4].name.clone();
        turned.images[4].keypoints.clear();
        let message = warned(&turned).unwrap();
        assert!(message.starts_with("1 of 12 views") && message.contains(&name), "{message}");
    }

    #[test]
    fn a_ring_with_wide_gaps_has_no_overlap() {
        let message = warned(&Scene::ring(4)).unwrap();
        assert!(message.starts_with("4 of 4 views"), "{message}");
    }
}
