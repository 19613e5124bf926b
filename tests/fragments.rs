//! Rasterised and blended fragments: a scene that can be counted by hand, and the reference, which tests every pixel.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::training::{config, damaged, photos, scene};
use glam::{DMat3, DVec3};
use litetex_gs::backend::{Backend, ColourMap};
use litetex_gs::camera::{Camera, Pinhole, RigidTransform, Similarity};
use litetex_gs::cpu::{CpuBackend, blended_fragments};
use litetex_gs::model::{Filter, Model, SplatArrays, TextureMap, TexturePool};
use litetex_gs::rasterised_fragments;
use litetex_gs::reference::{AlphaCutoff, ColourGradient, Fragments, Params, Settings, fragments};
use litetex_gs::run::LayersPerPixel;
use litetex_gs::selftest::{SceneOptions, random_scene};
use litetex_gs::train::density::{Budget, DensityConfig};
use litetex_gs::train::{Control, Policy, TrainConfig, TrainState, train};

/// Side of the image, and focal length.
const SIDE_PX: u32 = 9;
const FOCAL_PX: f64 = 10.0;

fn reference(model: &Model, camera: &Camera) -> Fragments {
    let settings = Settings {
        cutoff: AlphaCutoff::Hard,
        colour_gradient: ColourGradient::Strict,
        near: f64::from(model.near),
        filter_px2: model.filter.variance_px2(),
        sh_degree: 0,
        background: [0.0; 3],
        exposure: ColourMap::IDENTITY,
    };
    fragments(&Params::from_model(model), camera, &settings)
}

fn camera() -> Camera {
    let middle_px = 0.5 * f64::from(SIDE_PX);
    Camera {
        pinhole: Pinhole {
            width_px: SIDE_PX,
            height_px: SIDE_PX,
            fx_px: FOCAL_PX,
            fy_px: FOCAL_PX,
            cx_px: middle_px,
            cy_px: middle_px,
        },
        camera_from_local: RigidTransform { rotation: DMat3::IDENTITY, translation: DVec3::ZERO },
    }
}

/// A disc that faces the camera: pixel at whose centre it lies, depth, opacity, radius of its support.
struct Disc {
    pixel: [i32; 2],
    depth: f64,
    opacity: f64,
    radius_px: f64,
}

fn model(discs: &[Disc]) -> Model {
    let mut splats = SplatArrays::zeros(discs.len(), 0);
    for (i, disc) in discs.iter().enumerate() {
        let per_px = disc.depth / FOCAL_PX;
        let from_middle_px = |k: usize| f64::from(disc.pixel[k]) + 0.5 - 0.5 * f64::from(SIDE_PX);
        let position = [from_middle_px(0) * per_px, from_middle_px(1) * per_px, disc.depth];
        (0..3).for_each(|k| splats.positions[3 * i + k] = position[k] as f32);
        splats.quaternions[4 * i] = 1.0;
        let sigmas = (2.0 * (255.0 * disc.opacity).ln()).sqrt();
        splats.log_scales[2 * i..][..2].fill((disc.radius_px * per_px / sigmas).ln() as f32);
        splats.opacity_logits[i] = (disc.opacity / (1.0 - disc.opacity)).ln() as f32;
    }
    let maps = vec![TextureMap::centred(0, 0, [0.0; 2]); discs.len()];
    Model {
        splats,
        textures: TexturePool::neutral(maps).unwrap(),
        near: 0.1,
        filter: Filter::None,
        capture_from_local: Similarity::IDENTITY,
    }
}

/// Discs whose fragments are 5, 9, 4, none, and one for each of five in a row with this opacity.
fn discs(opacity_of_row: f64) -> Vec<Disc> {
    let disc = |pixel: [i32; 2], depth: f64, radius_px: f64| Disc { pixel, depth, opacity: 0.5, radius_px };
    let mut discs = vec![
        // A pixel and its four neighbours; and their diagonal ones behind it.
        disc([4, 4], 1.0, 1.2),
        disc([4, 4], 2.0, 1.6),
        // One of five lies outside of the image.
        disc([0, 4], 1.0, 1.2),
        // Before the near plane.
        disc([4, 4], 0.09, 3.0),
    ];
    let row = (1..=5).map(f64::from);
    discs.extend(row.map(|depth| Disc { opacity: opacity_of_row, ..disc([8, 8], depth, 0.9) }));
    discs
}

#[test]
fn fragments_of_discs_are_those_counted_by_hand() {
    let pixels = f64::from(SIDE_PX * SIDE_PX);
    // 0.05^4 is below the transmittance at which a pixel stops, 0.05^3 is not; the support does not depend on the opacity.
    for (opacity, blended) in [(0.95, 18 + 3), (0.5, 18 + 5)] {
        let (model, camera) = (model(&discs(opacity)), camera());
        let expected = Fragments { rasterised: vec![5, 9, 4, 0, 1, 1, 1, 1, 1], blended };
        assert_eq!(reference(&model, &camera), expected);
        let found = rasterised_fragments(&model, &[camera]);
        let counts: Vec<u64> = found.iter().map(|of_splat| (of_splat * pixels).round() as u64).collect();
        assert_eq!(counts, expected.rasterised);
        assert_eq!((blended_fragments(&model, &[camera]) * pixels).round() as u64, blended);
        let layers = LayersPerPixel::of(&model, &[camera, camera]).unwrap();
        assert!((layers.rasterised - 23.0 / pixels).abs() < 1e-12, "{layers:?}");
        assert!((layers.blended - blended as f64 / pixels).abs() < 1e-12, "{layers:?}");
        // 5 % of nine splats is one.
        assert!((layers.share_of_largest - 9.0 / 23.0).abs() < 1e-12, "{layers:?}");
        assert_eq!((layers.views, layers.longer_side_px), (2, SIDE_PX));
    }
    // Negative control: a radius that reaches the diagonal neighbours.
    let mut wider = discs(0.95);
    wider[0].radius_px = 1.5;
    assert_eq!((rasterised_fragments(&model(&wider), &[camera()])[0] * pixels).round() as u64, 9);
    assert_eq!(LayersPerPixel::of(&model(&wider), &[]), None);
}

#[test]
fn fragments_are_those_of_the_reference() {
    let base = SceneOptions { num_splats: 1_200, sh_degree: 0, ..SceneOptions::default() };
    let mut hidden = Vec::new();
    for options in [
        base.clone(),
        SceneOptions { filter: Filter::None, seed: 6, ..base.clone() },
        // Many reach the plane of the camera, where supports are no ellipses.
        SceneOptions { num_splats: 400, scales: (0.1, 3.0), depths: (0.041, 0.5), seed: 2, ..base.clone() },
        SceneOptions { scales: (1e-4, 0.01), seed: 3, ..base.clone() },
        SceneOptions { scales: (1e-4, 2.0), seed: 4, ..base.clone() },
        SceneOptions { width_px: 700, height_px: 37, num_splats: 150, seed: 5, ..base },
    ] {
        let scene = random_scene(&options);
        let expected = reference(&scene.model, &scene.camera);
        let pixels = scene.camera.pinhole.num_pixels() as f64;
        let found: Vec<u64> = rasterised_fragments(&scene.model, &[scene.camera])
            .iter()
            .map(|of_splat| (of_splat * pixels).round() as u64)
            .collect();
        let total: u64 = expected.rasterised.iter().sum();
        let off: u64 = found.iter().zip(&expected.rasterised).map(|(a, b)| a.abs_diff(*b)).sum();
        let blended = blended_fragments(&scene.model, &[scene.camera]) * pixels;
        println!("{total} rasterised, {off} differ; {} blended, here {blended:.0}", expected.blended);
        hidden.push(total - expected.blended);
        // Both are f64: only a centre on the very edge could differ.
        assert_eq!(off, 0, "seed {}", options.seed);
        // f32 flips centres near edges.
        let ratio = blended / expected.blended as f64;
        assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
        // Negative control: smaller supports.
        let mut smaller = scene.model.clone();
        smaller.splats.log_scales.iter_mut().for_each(|scale| *scale -= 0.1);
        let fewer = rasterised_fragments(&smaller, &[scene.camera]).iter().sum::<f64>() * pixels;
        let other = blended_fragments(&smaller, &[scene.camera]) * pixels / expected.blended as f64;
        println!("  smaller: {:.4} rasterised, {other:.4} blended", fewer / total as f64);
        assert!(fewer < 0.997 * total as f64 && (other - 1.0).abs() > 2e-3);
    }
    assert!(hidden.iter().filter(|&&fragments| fragments > 10_000).count() > 2, "{hidden:?}");
}

#[test]
fn counts_do_not_depend_on_the_number_of_threads() {
    let scene = random_scene(&SceneOptions { num_splats: 1_000, ..SceneOptions::default() });
    let of_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| LayersPerPixel::of(&scene.model, &[scene.camera, camera()]))
    };
    assert_eq!(of_threads(1), of_threads(3));
}

/// Layers per pixel and parameters of a model that was trained within a budget, and pruned at a price of fragments.
fn trained(backend: &mut dyn Backend, price_fragments: f64) -> (f64, usize) {
    let start = damaged(&scene());
    let views = photos(&scene());
    let config = TrainConfig {
        policy: Policy::Litetex,
        save_every: 0,
        eval_every: 0,
        density: DensityConfig { price_fragments, ..DensityConfig::default() },
        budget: Budget { max_params: Some(start.num_params() / 2), ..Budget::default() },
        ..config(150)
    };
    let state = TrainState::fresh(start);
    let (state, _) = train(&config, backend, &views, state, &mut |_| Ok(Control::Continue)).unwrap();
    let cameras: Vec<Camera> = views.0.iter().map(|(camera, _)| *camera).collect();
    (rasterised_fragments(&state.model, &cameras).iter().sum(), state.model.num_params())
}

#[test]
fn a_price_lowers_the_layers_at_the_same_budget() {
    let mut backends: Vec<Box<dyn Backend>> = vec![Box::new(CpuBackend::new(Some(2)).unwrap())];
    #[cfg(feature = "gpu")]
    if let Some(gpu) = common::gpu::backend(litetex_gs::gpu::GpuOptions::default()) {
        backends.push(Box::new(gpu));
    }
    for backend in &mut backends {
        let [(without, params), (with, params_with)] =
            [0.0, 4.0].map(|price| trained(backend.as_mut(), price));
        println!("{}: {without:.2} layers, {with:.2} with a price", backend.device().name);
        assert!(params.abs_diff(params_with) < params / 20, "{params}, {params_with} parameters");
        assert!(with < 0.9 * without, "{with}, {without}");
    }
}
