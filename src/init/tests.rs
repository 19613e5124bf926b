//! Behaviour of the initial model.

use super::*;
use crate::capture::fixtures::Scene;
use crate::capture::{Capture, LoadOptions};
use crate::train::Policy;
use crate::views::{Split, ViewSource as _};
use tempfile::tempdir;

fn capture(scene: &Scene) -> Capture {
    let folder = tempdir().unwrap();
    scene.write(folder.path());
    // No photo is needed: the folder may go.
    Capture::load(folder.path(), &LoadOptions::default()).unwrap()
}

fn made_from(capture: &Capture, points: InitPoints<'_>, options: &InitOptions) -> Result<(Model, Report)> {
    let input = InitInput {
        views: capture,
        points,
        points_file: &capture.poses,
        capture_from_local: capture.capture_from_local,
        near: capture.near,
    };
    initial_model(&input, options).map(|first| (first.model, first.report))
}

/// From the points of the capture.
fn sparse(capture: &Capture, options: &InitOptions) -> (Model, Report) {
    made_from(capture, InitPoints::Sparse(&capture.points), options).unwrap()
}

fn random(capture: &Capture, count: usize) -> Model {
    made_from(capture, InitPoints::Random(count), &InitOptions::default()).unwrap().0
}

#[test]
fn points_become_splats_with_the_documented_parameters() {
    let mut scene = Scene::ring(5);
    // A square of side 2 and a point far away: spacing of a corner is (4 + 4 + 8) / 3.
    let corners = [[0., 0., 0.], [2., 0., 0.], [0., 2., 0.], [2., 2., 0.], [0., 0., 20.]];
    scene.points = corners.map(|p| (p, [255, 0, 51])).to_vec();
    let capture = capture(&scene);
    let options = InitOptions { policy: Policy::Fixed(4), ..InitOptions::default() };
    let (model, report) = sparse(&capture, &options);
    assert_eq!(model.num_splats(), 5);
    assert!(report.warnings.is_empty(), "{report:?}");
    let scale = capture.capture_from_local.scale;
    let in_capture = |index: usize| {
        let local = &model.splats.positions[3 * index..3 * index + 3];
        let local = glam::DVec3::new(local[0].into(), local[1].into(), local[2].into());
        model.capture_from_local.transform_point(local)
    };
    // Splats are stored along a curve, not in the order of the points.
    let splat_at = |corner: [f64; 3]| {
        let is_there = |&i: &usize| in_capture(i).distance(glam::DVec3::from_array(corner)) < 1e-5;
        (0..5).find(is_there).unwrap()
    };
    for corner in &corners[..4] {
        let index = splat_at(*corner);
        let sigma = f64::from(model.splats.log_scales[2 * index].exp());
        assert!((sigma * scale - (16.0_f64 / 3.0).sqrt()).abs() < 1e-4);
    }
    let far = splat_at(corners[4]);
    assert_eq!(model.splats.log_scales[2 * far].exp(), 1.0, "bounded by the cameras' extent");
    assert!((1.0 / (1.0 + (-model.splats.opacity_logits[0]).exp()) - 0.1).abs() < 1e-6);
    let dc: Vec<f64> = (0..3).map(|c| 0.5 + 0.282_094_79 * f64::from(model.splats.sh[c])).collect();
    assert!((dc[0] - 1.0).abs() + dc[1].abs() + (dc[2] - 0.2).abs() < 1e-6);
    assert!(model.splats.sh[3..48].iter().all(|&v| v == 0.0));
    let map = &model.textures.maps[0];
    assert_eq!((map.rows, map.cols), (4, 4));
    let half = (2.0 * 25.5_f64.ln()).sqrt() * f64::from(model.splats.log_scales[0].exp());
    assert!((f64::from(map.texel_sizes[0]) - 2.0 * half / 3.0).abs() < 1e-6);
    assert!(model.textures.texels.iter().all(|&t| t == 0.0) && model.num_texels() == 80);
}

#[test]
fn untextured_models_have_empty_maps() {
    let options = InitOptions { policy: Policy::None, sh_degree: 0, ..InitOptions::default() };
    let (model, _) = sparse(&capture(&Scene::ring(5)), &options);
    assert_eq!((model.num_texels(), model.splats.sh.len()), (0, 60));
    assert!(model.textures.maps.iter().all(|m| m.rows == 0 && m.cols == 0));
}

#[test]
fn unusable_points_are_left_out_and_counted() {
    let mut scene = Scene::ring(5);
    let (q, t) = scene.images[2].camera_from_world;
    scene.points[0].0 = (-(q.inverse() * t)).to_array();
    scene.points[2] = scene.points[3];
    let mut capture = capture(&scene);
    capture.points[1].position_in_capture.x = f64::NAN;
    let (model, report) = sparse(&capture, &InitOptions::default());
    assert_eq!(model.num_splats(), 17);
    for code in ["points-at-camera", "points-not-finite", "points-duplicate"] {
        assert!(report.warnings.iter().any(|w| w.code == code && w.count == 1), "{code}");
    }
}

#[test]
fn thinning_keeps_the_order_and_depends_on_the_seed_only() {
    let capture = capture(&Scene::ring(5));
    let thin = |seed| {
        let options = InitOptions { max_points: 7, seed, ..InitOptions::default() };
        sparse(&capture, &options).0
    };
    assert_eq!(thin(1).num_splats(), 7);
    assert_eq!(thin(1), thin(1));
    assert_ne!(thin(1), thin(2));
}

#[test]
fn random_points_are_in_view_of_a_third_of_the_cameras() {
    let capture = capture(&Scene::ring(9));
    let model = random(&capture, 500);
    assert_eq!(model.num_splats(), 500);
    let train = capture.indices(Split::Train);
    for p in model.splats.positions.chunks_exact(3) {
        let p = glam::DVec3::new(p[0].into(), p[1].into(), p[2].into());
        let seen = train.iter().filter(|&&v| {
            let camera = capture.views[v].camera;
            let at = camera.pinhole.project(camera.camera_from_local.transform_point(p));
            at.is_some_and(|at| at.x >= 0.0 && at.y >= 0.0 && at.x <= 12.0 && at.y <= 8.0)
        });
        assert!(3 * seen.count() >= train.len());
    }
    assert_eq!(model, random(&capture, 500));
}

#[test]
fn parallel_cameras_get_points_along_their_rays() {
    let mut scene = Scene::ring(4);
    scene.points.clear();
    for (index, image) in scene.images.iter_mut().enumerate() {
        image.keypoints.clear();
        image.camera_from_world = (glam::DQuat::IDENTITY, glam::DVec3::new(index as f64, 0.0, 0.0));
    }
    let capture = capture(&scene);
    let model = random(&capture, 20_000);
    assert_eq!(model.num_splats(), 20_000);
    assert!(model.splats.positions.chunks_exact(3).all(|p| p[2] > 0.49 && p[2] < 20.1));
    let none = made_from(&capture, InitPoints::Sparse(&[]), &InitOptions::default());
    assert!(matches!(none, Err(Error::InvalidInput { .. })));
}

#[test]
fn quaternions_are_uniform_over_all_orthants() {
    let model = random(&capture(&Scene::ring(9)), 4000);
    let mut orthants = [0; 16];
    for q in model.splats.quaternions.chunks_exact(4) {
        assert!((q.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5);
        orthants[(0..4).map(|i| usize::from(q[i] > 0.0) << i).sum::<usize>()] += 1;
    }
    // 250 each; 5 standard deviations.
    assert!(orthants.iter().all(|&n| (170..330).contains(&n)), "{orthants:?}");
}
