//! The reference's gradients against central differences, for every kind of parameter.
//!
//! The smooth cut-off makes the picture differentiable but for kinks of measure zero (texel centres,
//! the L1 term, the colour clamp): a share of entries near one is allowed and counted.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use litetex_gs::backend::LossWeights;
use litetex_gs::model::SplatGroup;
use litetex_gs::reference::{AlphaCutoff, ColourGradient, Params, Settings, gradients};
use litetex_gs::selftest::{Scene, SceneOptions, random_scene};

const WEIGHTS: LossWeights = LossWeights { l1: 0.8, dssim: 0.2, mse: 0.03, opacity: 0.01, texture: 1e-3 };

fn settings(scene: &Scene) -> Settings {
    Settings {
        cutoff: AlphaCutoff::Smooth,
        colour_gradient: ColourGradient::Strict,
        near: f64::from(scene.model.near),
        sh_degree: scene.model.splats.sh_degree,
        background: [0.3, 0.5, 0.2],
    }
}

fn small(sh_degree: u32, seed: u64) -> SceneOptions {
    SceneOptions {
        num_splats: 6,
        sh_degree,
        map_sizes: vec![(2, 2), (9, 5), (3, 4), (0, 0)],
        width_px: 24,
        height_px: 20,
        scales: (0.05, 0.4),
        opacities: (0.2, 0.9),
        depths: (0.8, 2.0),
        seed,
    }
}

struct Outcome {
    checked: usize,
    non_zero: usize,
    worst: f64,
    off: Vec<String>,
}

/// Compares analytic and numeric derivatives of the total loss. An entry is off if the difference
/// exceeds `tolerance` times the largest derivative of its group.
fn check(scene: &Scene, settings: &Settings, tolerance: f64, analytic_factor: f64) -> Outcome {
    let params = Params::from_model(&scene.model);
    let loss = |p: &Params| gradients(p, &scene.camera, &scene.target, &WEIGHTS, settings).loss.total;
    let analytic = gradients(&params, &scene.camera, &scene.target, &WEIGHTS, settings).params;
    let mut outcome = Outcome { checked: 0, non_zero: 0, worst: 0.0, off: Vec::new() };
    let mut compare = |name: &str, analytic: &[f64], perturb: &dyn Fn(&mut Params, usize, f64)| {
        let largest = analytic.iter().fold(1e-9_f64, |m, g| m.max(g.abs()));
        let numeric_at = |i: usize| {
            let eps = 2e-6;
            let [up, down] = [eps, -eps].map(|e| {
                let mut p = params.clone();
                perturb(&mut p, i, e);
                loss(&p)
            });
            (up - down) / (2.0 * eps)
        };
        for (i, g) in analytic.iter().enumerate() {
            let error = (numeric_at(i) - g * analytic_factor).abs() / largest;
            outcome.checked += 1;
            outcome.non_zero += usize::from(g.abs() > 1e-3 * largest);
            if error > tolerance {
                outcome.off.push(format!("{name}[{i}]: {error:.1e} of {largest:.1e}"));
            } else {
                outcome.worst = outcome.worst.max(error);
            }
        }
    };
    for group in SplatGroup::ALL {
        compare(&format!("{group:?}"), analytic.group(group), &|p, i, e| p.group_mut(group)[i] += e);
    }
    compare("Texel", &analytic.texels, &|p, i, e| p.texels[i] += e);
    outcome
}

#[test]
fn reference_gradients_match_central_differences_for_every_sh_degree() {
    for sh_degree in 0..=3 {
        for seed in 0..3 {
            let scene = random_scene(&small(sh_degree, seed));
            let outcome = check(&scene, &settings(&scene), 2e-5, 1.0);
            println!(
                "sh {sh_degree} seed {seed}: {} checked, worst {:.1e}, off {:?}",
                outcome.checked, outcome.worst, outcome.off
            );
            // Entries near a kink: at most 2 in 100.
            assert!(outcome.off.len() * 50 <= outcome.checked, "{:?}", outcome.off);
            assert!(outcome.non_zero * 4 > outcome.checked, "{} of {}", outcome.non_zero, outcome.checked);
        }
    }
}

#[test]
fn a_wrong_gradient_is_noticed() {
    let scene = random_scene(&small(1, 0));
    let outcome = check(&scene, &settings(&scene), 2e-5, 1.001);
    assert!(outcome.off.len() * 50 > outcome.checked, "{} of {}", outcome.off.len(), outcome.checked);
}

#[test]
fn reference_gradients_hold_near_the_camera_and_edge_on() {
    let near = SceneOptions { depths: (0.05, 0.3), scales: (0.05, 0.3), ..small(1, 7) };
    let needles = SceneOptions { scales: (0.004, 0.6), ..small(1, 8) };
    for options in [near, needles] {
        let mut scene = random_scene(&options);
        // Turn the first splat until it is seen under 2 degrees.
        let in_camera =
            scene.camera.camera_from_local.transform_point(Params::from_model(&scene.model).position(0));
        let local = scene.camera.camera_from_local.rotation.transpose();
        let view = (local * in_camera).normalize();
        let side = view.any_orthonormal_vector();
        let normal = (side + view * 0.035).normalize();
        let rotation = glam::DMat3::from_cols(
            normal.any_orthonormal_vector(),
            normal.cross(normal.any_orthonormal_vector()),
            normal,
        );
        let q = glam::DQuat::from_mat3(&rotation);
        for (k, v) in [q.w, q.x, q.y, q.z].into_iter().enumerate() {
            scene.model.splats.quaternions[k] = v as f32;
        }
        let outcome = check(&scene, &settings(&scene), 5e-5, 1.0);
        println!("{} checked, worst {:.1e}, off {:?}", outcome.checked, outcome.worst, outcome.off);
        assert!(outcome.off.len() * 25 <= outcome.checked, "{:?}", outcome.off);
    }
}
