//! The gradients of the reference against central differences, separately for every kind of parameter.
//!
//! With the smooth cut-off, the image is differentiable except at kinks of measure zero (texel centres, the L1
//! term, the colour clamp); with differences this small, none of these scenes meets one.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use glam::{DMat3, DQuat, DVec2, DVec3};
use litetex_gs::backend::{ColourMap, LossWeights};
use litetex_gs::model::{Filter, SplatGroup};
use litetex_gs::reference::{
    AlphaCutoff, ColourGradient, Constants, Params, Settings, gradients, gradients_at, hit, project,
};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};

const WEIGHTS: LossWeights = LossWeights {
    l1: 0.8,
    dssim: 0.2,
    mse: 0.03,
    opacity: 0.01,
    texture: 1e-3,
    distortion: 1e4,
    normal: 0.2,
};
/// Relative to the largest derivative of the kind; needed 8e-7, because of rounding in the differences, which
/// varies with the maths library.
const TOLERANCE: f64 = 2e-6;
/// As `TOLERANCE`, close to the camera, where the ramp of the cut-off is steep; needed 2e-4, because of truncation.
const TOLERANCE_NEAR: f64 = 5e-4;
/// The parameter groups of splats, and texels.
const NUM_KINDS: usize = 6;

fn settings(scene: &RandomScene) -> Settings {
    Settings {
        cutoff: AlphaCutoff::Smooth,
        colour_gradient: ColourGradient::Strict,
        near: f64::from(scene.model.near),
        filter_px2: scene.model.filter.variance_px2(),
        sh_degree: scene.model.splats.sh_degree(),
        background: [0.3, 0.5, 0.2],
        exposure: ColourMap::IDENTITY,
    }
}

/// With the low-pass filter for every other seed.
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
        filter: if seed.is_multiple_of(2) { Filter::None } else { Filter::Ewa },
        seed,
    }
}

/// Array of a kind: the groups of splats in order, then the texels.
fn array(params: &mut Params, kind: usize) -> &mut [f64] {
    match SplatGroup::ALL.get(kind) {
        Some(group) => params.splats.group_mut(*group),
        None => &mut params.texels,
    }
}

/// Errors of the derivatives of one kind.
struct GradientErrors {
    kind: usize,
    /// Error of each entry, relative to the largest derivative of the kind.
    errors: Vec<f64>,
    /// Entries above a thousandth of the largest.
    non_zero: usize,
}

impl GradientErrors {
    fn passes(&self, tolerance: f64) -> bool {
        let worst = self.errors.iter().fold(0.0_f64, |m, e| m.max(*e));
        println!(
            "kind {}: {} entries, {} non-zero, worst error {worst:.1e}",
            self.kind,
            self.errors.len(),
            self.non_zero
        );
        worst < tolerance && self.non_zero * 8 >= self.errors.len()
    }
}

/// The footprints of the splats, and one normal of the depth map per pixel.
fn constants(scene: &RandomScene, settings: &Settings, normal: impl Fn(usize) -> DVec3) -> Constants {
    let params = Params::from_model(&scene.model);
    let footprint = |i: usize| {
        project(&params, i, &scene.camera, settings).map_or([1.0; 2], |projected| projected.footprint_texels)
    };
    Constants {
        normals: (0..scene.camera.pinhole.num_pixels()).map(normal).collect(),
        footprints_texels: (0..params.splats.len()).map(footprint).collect(),
    }
}

/// Compares all kinds; the analytic derivatives of kind `perturbed` are changed by a thousandth.
fn check(scene: &RandomScene, settings: &Settings, perturbed: Option<usize>) -> Vec<GradientErrors> {
    let params = Params::from_model(&scene.model);
    // The depth map's normals are constants in the derivative; here they are made up and different everywhere.
    let normal =
        |i: usize| DVec3::new(0.5 * (i as f64).sin(), 0.4 * (0.7 * i as f64).cos(), -1.0).normalize();
    let constants = constants(scene, settings, normal);
    let fixed = Some(&constants);
    let base = gradients_at(&params, &scene.camera, &scene.target, &WEIGHTS, settings, fixed);
    assert!(base.loss.distortion > 1e-5 && base.loss.normal > 1e-3, "{:?}", base.loss);
    let loss =
        |p: &Params| gradients_at(p, &scene.camera, &scene.target, &WEIGHTS, settings, fixed).loss.total;
    let mut analytic = base.params;
    let mut outcomes = Vec::new();
    for kind in 0..NUM_KINDS {
        let factor = if perturbed == Some(kind) { 1.001 } else { 1.0 };
        let analytic: Vec<f64> = array(&mut analytic, kind).iter().map(|g| g * factor).collect();
        let largest = analytic.iter().fold(1e-9_f64, |m, g| m.max(g.abs()));
        let numeric = |i: usize| {
            let eps = 2e-7;
            let [up, down] = [eps, -eps].map(|e| {
                let mut p = params.clone();
                array(&mut p, kind)[i] += e;
                loss(&p)
            });
            (up - down) / (2.0 * eps)
        };
        let errors = analytic.iter().enumerate().map(|(i, g)| (numeric(i) - g).abs() / largest).collect();
        let non_zero = analytic.iter().filter(|g| g.abs() > 1e-3 * largest).count();
        outcomes.push(GradientErrors { kind, errors, non_zero });
    }
    outcomes
}

#[test]
fn every_kind_matches_central_differences_for_every_sh_degree() {
    for sh_degree in 0..=3 {
        for seed in 0..4 {
            let scene = random_scene(&small(sh_degree, seed));
            println!("SH degree {sh_degree}, seed {seed}");
            assert!(
                check(&scene, &settings(&scene), None)
                    .iter()
                    .map(|o| o.passes(TOLERANCE))
                    .fold(true, |a, b| a & b)
            );
        }
    }
}

#[test]
fn gradients_pass_through_the_exposure_of_the_photo() {
    let scene = random_scene(&small(1, 0));
    let exposure = ColourMap([[1.3, 0.1, -0.05, 0.02], [0.05, 0.8, 0.1, -0.04], [-0.1, 0.15, 1.1, 0.06]]);
    let settings = Settings { exposure, ..settings(&scene) };
    assert!(check(&scene, &settings, None).iter().map(|o| o.passes(TOLERANCE)).fold(true, |a, b| a & b));
}

#[test]
fn gradients_pass_through_the_low_pass_filter() {
    for seed in [11, 13] {
        // Some 0.1 to 2 px across.
        let scene = random_scene(&SceneOptions { scales: (0.01, 0.2), num_splats: 20, ..small(1, seed) });
        let with = settings(&scene);
        let params = Params::from_model(&scene.model);
        let thinned = (0..params.splats.len())
            .filter_map(|i| project(&params, i, &scene.camera, &with))
            .filter(|p| p.opacity < 0.8 * p.stored_opacity)
            .count();
        assert!(thinned >= 4, "only {thinned} splats feel the filter");
        assert!(check(&scene, &with, None).iter().all(|o| o.passes(TOLERANCE)), "seed {seed}");
    }
}

#[test]
fn gradients_pass_through_maps_with_several_texels_a_pixel() {
    for seed in [11, 13] {
        let mut scene = random_scene(&SceneOptions { num_splats: 20, ..small(1, seed) });
        for map in &mut scene.model.textures.maps {
            map.texel_sizes = map.texel_sizes.map(|size| 0.15 * size);
        }
        let settings = settings(&scene);
        let params = Params::from_model(&scene.model);
        let minified = (0..params.splats.len())
            .filter_map(|i| project(&params, i, &scene.camera, &settings))
            .filter(|p| p.footprint_texels.iter().any(|&w| w > 1.5 && w < 8.0))
            .count();
        assert!(minified >= 4, "only {minified} maps have several texels a pixel");
        assert!(check(&scene, &settings, None).iter().all(|o| o.passes(TOLERANCE)), "seed {seed}");
    }
}

#[test]
fn a_wrong_gradient_of_any_kind_is_detected() {
    let scene = random_scene(&small(1, 0));
    for perturbed in 0..NUM_KINDS {
        let outcomes = check(&scene, &settings(&scene), Some(perturbed));
        let failed: Vec<usize> = outcomes.iter().filter(|o| !o.passes(TOLERANCE)).map(|o| o.kind).collect();
        assert_eq!(failed, [perturbed]);
    }
}

/// Moves splat 0 to the middle of the image and turns it to two degrees from edge-on.
fn turn_edge_on(scene: &mut RandomScene) {
    let local_from_camera = scene.camera.camera_from_local.inverse();
    let pinhole = scene.camera.pinhole;
    let ray = pinhole.direction_in_camera(DVec2::new(12.3, 9.8));
    let position = local_from_camera.transform_point(ray);
    let view = (local_from_camera.rotation * ray).normalize();
    let normal = (view.any_orthonormal_vector() + view * 0.035).normalize();
    let e_u = normal.any_orthonormal_vector();
    let q = DQuat::from_mat3(&DMat3::from_cols(e_u, normal.cross(e_u), normal));
    let splats = &mut scene.model.splats;
    (0..3).for_each(|k| splats.positions[k] = position[k] as f32);
    splats.quaternions[..4].copy_from_slice(&[q.w, q.x, q.y, q.z].map(|v| v as f32));
    splats.log_scales[..2].fill(-1.5);
    splats.opacity_logits[0] = 1.5;
}

#[test]
fn gradients_are_correct_for_a_splat_seen_edge_on() {
    for filter in [Filter::None, Filter::Ewa] {
        let mut scene = random_scene(&SceneOptions { filter, ..small(1, 8) });
        turn_edge_on(&mut scene);
        let settings = settings(&scene);
        let outcomes = check(&scene, &settings, None);
        assert!(outcomes.iter().map(|o| o.passes(TOLERANCE)).fold(true, |a, b| a & b));
        // The splat itself receives a gradient.
        let params = Params::from_model(&scene.model);
        let analytic = gradients(&params, &scene.camera, &scene.target, &WEIGHTS, &settings).params;
        let by_position = &analytic.splats.positions[..3];
        assert!(by_position.iter().all(|g| g.abs() > 1e-6), "{by_position:?}");
    }
}

#[test]
fn gradients_are_correct_for_discs_that_cross_the_near_plane() {
    let mut crossing = 0;
    for seed in 7..10 {
        let near = SceneOptions { depths: (0.05, 0.3), scales: (0.05, 0.3), ..small(1, seed) };
        let scene = random_scene(&near);
        let settings = settings(&scene);
        let params = Params::from_model(&scene.model);
        for i in 0..params.splats.len() {
            let Some(p) = project(&params, i, &scene.camera, &settings) else { continue };
            let reach: f64 = (0..2).map(|k| 3.0 * (p.scales[k] * p.axes_in_camera[k].z).abs()).sum();
            let seen = (0..480).any(|px| {
                hit(&p, DVec2::new((px % 24) as f64 + 0.5, (px / 24) as f64 + 0.5), &settings).is_some()
            });
            crossing += usize::from(seen && p.depth - reach < settings.near);
        }
        assert!(check(&scene, &settings, None).iter().all(|o| o.passes(TOLERANCE_NEAR)), "seed {seed}");
    }
    assert!(crossing >= 5, "only {crossing} discs cross the near plane: nothing was tested");
}

#[test]
fn the_geometry_terms_matter_in_these_scenes() {
    let scene = random_scene(&small(1, 0));
    let (params, settings) = (Params::from_model(&scene.model), settings(&scene));
    let constants = constants(&scene, &settings, |_| DVec3::new(0.3, -0.2, -0.9).normalize());
    for off in [LossWeights { distortion: 0.0, ..WEIGHTS }, LossWeights { normal: 0.0, ..WEIGHTS }] {
        let gradient = |weights: &LossWeights| {
            gradients_at(&params, &scene.camera, &scene.target, weights, &settings, Some(&constants)).params
        };
        let (mut with, mut without) = (gradient(&WEIGHTS), gradient(&off));
        // Without the term, derivatives w.r.t. positions, rotations and opacities change by far more than the tolerance.
        for kind in [0, 1, 3] {
            let (a, b) = (array(&mut with, kind).to_vec(), array(&mut without, kind).to_vec());
            let largest = a.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            let apart = a.iter().zip(&b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(apart > 1e-4 * largest, "kind {kind}: {apart:.1e} of {largest:.1e}");
        }
    }
}
