//! Training views that share too little with any other to be reconstructed, since nothing ties down what they show; and
//! captures that have few of them.

use super::loaded::View;
use super::source::{Source, first_names};
use crate::Report;
use crate::camera::{Camera, Similarity};
use crate::text::counted;
use crate::views::Split;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// With fewer training views, what only one of them shows is a large part of the scene: 9 instead of 35 cost 0.8 dB and 6
/// cost 2.3 dB (lab/stress.md), 12 as little as they vary.
const VIEWS_MIN: usize = 12;

/// A view needs another that shows this share of its points. Over the views of four real captures the smallest share is
/// 0.26; with every sixth view only, two of them have views at 0.10 and 0.19.
const SHARED_MIN: f64 = 0.2;

/// Of more points, as many evenly spaced ones stand for all.
const POINTS_MAX: usize = 4096;

/// Cosine of the angle between optical axes up to which two views show the same side of things: 75 degrees.
const SAME_SIDE_COS: f64 = 0.26;

/// Depths at which things are supposed where no points are known, local units.
const DEPTHS: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];

/// Positions along each side of a view where they are supposed.
const GRID: usize = 4;

/// Warns of few training views, and of those that share less than a fifth of what they show with each other one.
pub(super) fn check(views: &[View], source: &Source, capture_from_local: &Similarity, report: &mut Report) {
    let train: Vec<usize> = (0..views.len()).filter(|&view| views[view].split == Split::Train).collect();
    if train.len() < VIEWS_MIN {
        let what = format!(
            "only {}: what a single one shows stays vague; take more photos, at least 30",
            counted(train.len(), "training view")
        );
        report.warn("few-training-views", train.len(), what);
    }
    if train.len() < 2 {
        return;
    }
    let cameras: Vec<Camera> = train.iter().map(|&view| views[view].camera).collect();
    let observed: Vec<&[u32]> = train.iter().map(|&view| &*source.views[view].observed).collect();
    let shares = if observed.iter().any(|points| !points.is_empty()) {
        by_tracks(&observed, source.points.len())
    } else if source.points.is_empty() {
        by_frusta(&cameras)
    } else {
        let local_from_capture = capture_from_local.inverse();
        let points = source.points.iter().step_by(source.points.len().div_ceil(POINTS_MAX));
        let points = points.map(|point| local_from_capture.transform_point(point.position_in_capture));
        by_points(&cameras, &points.collect::<Vec<_>>())
    };
    let alone = train.iter().zip(shares).filter(|(_, share)| share.is_some_and(|share| share < SHARED_MIN));
    let alone: Vec<&str> = alone.map(|(&view, _)| views[view].name.as_str()).collect();
    if !alone.is_empty() {
        let count = alone.len();
        let what = format!(
            "no other training view shows {:.0} % of what these do: {} ({count} of {}); what they show stays vague: \
             take more photos between them and the others",
            100.0 * SHARED_MIN,
            first_names(alone),
            train.len()
        );
        report.warn("views-without-overlap", count, what);
    }
}

/// For each view, the largest share of the points triangulated from it that were also triangulated from one other.
fn by_tracks(observed: &[&[u32]], num_points: usize) -> Vec<Option<f64>> {
    let mut seen_by = vec![Vec::new(); num_points];
    for (view, points) in observed.iter().enumerate() {
        points.iter().for_each(|&point| seen_by[point as usize].push(view));
    }
    let of_view = |view: usize| {
        let mut shared = vec![0_usize; observed.len()];
        for &point in observed[view] {
            seen_by[point as usize].iter().for_each(|&other| shared[other] += 1);
        }
        shared[view] = 0;
        share(shared.into_iter().max().unwrap_or(0), observed[view].len())
    };
    (0..observed.len()).into_par_iter().map(of_view).collect()
}

/// For each view, the largest share of the points within it that lie within one other of the same side.
fn by_points(cameras: &[Camera], points: &[DVec3]) -> Vec<Option<f64>> {
    let shown: Vec<Vec<u64>> = cameras.par_iter().map(|camera| shown(camera, points)).collect();
    let of_view = |view: usize| {
        let own: u32 = shown[view].iter().map(|bits| bits.count_ones()).sum();
        let shared =
            |other: usize| shown[view].iter().zip(&shown[other]).map(|(a, b)| (a & b).count_ones()).sum();
        let most: u32 = same_side(cameras, view).map(shared).max().unwrap_or(0);
        share(most as usize, own as usize)
    };
    (0..cameras.len()).into_par_iter().map(of_view).collect()
}

/// The same without points: at the depth where a view shares most.
fn by_frusta(cameras: &[Camera]) -> Vec<Option<f64>> {
    let of_view = |view: usize| {
        let Camera { pinhole, camera_from_local } = &cameras[view];
        let local_from_camera = camera_from_local.inverse();
        let side = |at: usize, side_px: u32| (at as f64 + 0.5) / GRID as f64 * f64::from(side_px);
        let shared_at = |depth: f64| {
            let point = |at: usize| {
                let at_px = DVec2::new(side(at % GRID, pinhole.width_px), side(at / GRID, pinhole.height_px));
                local_from_camera.transform_point(depth * pinhole.direction_in_camera(at_px))
            };
            let points: Vec<DVec3> = (0..GRID * GRID).map(point).collect();
            let shared = |other: usize| points.iter().filter(|&&point| cameras[other].shows(point)).count();
            same_side(cameras, view).map(shared).max().unwrap_or(0)
        };
        share(DEPTHS.into_iter().map(shared_at).max().unwrap_or(0), GRID * GRID)
    };
    (0..cameras.len()).into_par_iter().map(of_view).collect()
}

/// `None` for a view that shows nothing.
fn share(shared: usize, own: usize) -> Option<f64> {
    (own > 0).then(|| shared as f64 / own as f64)
}

/// Other views that show the same side of things.
fn same_side(cameras: &[Camera], view: usize) -> impl Iterator<Item = usize> {
    let axis = |view: usize| cameras[view].camera_from_local.rotation.row(2);
    (0..cameras.len()).filter(move |&other| other != view && axis(view).dot(axis(other)) > SAME_SIDE_COS)
}

/// A bit for each point: whether it lies within the view.
fn shown(camera: &Camera, points: &[DVec3]) -> Vec<u64> {
    let word = |points: &[DVec3]| {
        points.iter().enumerate().fold(0, |bits, (k, &point)| bits | u64::from(camera.shows(point)) << k)
    };
    points.chunks(64).map(word).collect()
}

#[cfg(test)]
mod tests {
    use crate::capture::fixtures::Scene;
    use crate::capture::{Capture, LoadOptions};
    use glam::{DMat3, DQuat, DVec3};

    /// The message of a warning about a capture of which every `test_every`-th view is held out.
    fn warned(scene: &Scene, code: &str, test_every: usize) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        scene.write(folder.path());
        let options = LoadOptions { test_every, ..LoadOptions::default() };
        let capture = Capture::load(folder.path(), &options).unwrap();
        let of = |w: &crate::Warning| (w.code == code).then(|| w.message.clone());
        capture.report.warnings.iter().find_map(of)
    }

    fn alone(scene: &Scene, test_every: usize) -> Option<String> {
        warned(scene, "views-without-overlap", test_every)
    }

    /// A ring of which one camera is turned down.
    fn with_one_turned() -> Scene {
        let mut scene = Scene::ring(12);
        let pose = &mut scene.images[4].camera_from_world;
        let rotation = DMat3::from_quat(pose.0);
        let centre = -(rotation.transpose() * pose.1);
        let x = DVec3::Y.cross(rotation.row(2)).normalize();
        let down = DMat3::from_cols(x, DVec3::NEG_Y.cross(x), DVec3::NEG_Y).transpose();
        *pose = (DQuat::from_mat3(&down), -(down * centre));
        for i in 0..20 {
            let p = centre - 5.0 * DVec3::Y + 0.05 * f64::from(i) * x;
            scene.points.push((p.to_array(), [9; 3]));
        }
        scene.images[4].keypoints = (20..40).map(|point| (1.0, 1.0, point)).collect();
        scene
    }

    fn without_tracks(mut scene: Scene) -> Scene {
        scene.images.iter_mut().for_each(|image| image.keypoints.clear());
        scene
    }

    fn without_points(scene: Scene) -> Scene {
        Scene { points: Vec::new(), ..without_tracks(scene) }
    }

    #[test]
    fn a_view_that_looks_at_something_else_is_named() {
        for change in [|scene| scene, without_tracks, without_points] {
            assert_eq!(alone(&change(Scene::ring(12)), 0), None);
            let scene = change(with_one_turned());
            let message = alone(&scene, 0).unwrap();
            assert!(message.contains(&scene.images[4].name) && message.contains("(1 of 12)"), "{message}");
        }
    }

    #[test]
    fn tracks_come_before_frusta() {
        let scene = Scene::ring(4);
        assert_eq!(alone(&scene, 0), None, "all photos have tracks of all points");
        let message = alone(&without_tracks(scene), 0).unwrap();
        assert!(message.contains("(4 of 4)"), "{message}");
    }

    #[test]
    fn views_held_out_do_not_count() {
        // Every point is triangulated from two neighbours, one of which is held out.
        let mut scene = Scene::ring(12);
        scene.images.sort_by(|a, b| a.name.cmp(&b.name));
        for (at, image) in scene.images.iter_mut().enumerate() {
            let first = at as i64 / 2 * 3;
            image.keypoints = (first..first + 3).map(|point| (1.0, 1.0, point)).collect();
        }
        assert_eq!(alone(&scene, 0), None);
        assert!(alone(&scene, 2).unwrap().contains("(6 of 6)"));
    }

    #[test]
    fn few_training_views_bring_a_warning() {
        let few = |count, test_every| warned(&Scene::ring(count), "few-training-views", test_every);
        assert_eq!(few(12, 0), None);
        assert!(few(12, 8).unwrap().starts_with("only 10 training views:"));
        assert!(few(2, 2).unwrap().starts_with("only 1 training view:"));
    }
}
