//! Poisoned input: the answer is a clean picture and clean gradients, or a typed error.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use litetex_gs::Error;
use litetex_gs::backend::{
    Backend as _, LearningRates, LossWeights, RenderOptions, StepRequest, TargetImage,
};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::AdamState;
use litetex_gs::selftest::{Scene, SceneOptions, random_scene};

const RATES: LearningRates = LearningRates {
    position: 1e-4,
    quaternion: 1e-3,
    log_scale: 5e-3,
    opacity: 0.05,
    sh_dc: 2.5e-3,
    sh_rest: 1e-4,
    texel: 1e-3,
};

/// Renders and takes three steps; every pixel and every parameter that was finite must stay so.
fn survives(scene: &Scene, name: &str) -> f64 {
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let options = RenderOptions { background: [0.1, 0.2, 0.3], sh_degree: 3, geometry: true };
    let image = backend.render(&scene.camera, &options).unwrap();
    let clean = |values: &[f32]| values.iter().all(|v| v.is_finite());
    assert!(
        clean(&image.rgb) && clean(&image.alpha) && clean(&image.depth) && clean(&image.normal),
        "{name}"
    );
    for step in 1..=3 {
        let report = backend
            .step(&StepRequest {
                step,
                camera: scene.camera,
                photo: 0,
                target: &scene.target,
                background: options.background,
                sh_degree: scene.model.splats.sh_degree,
                loss: LossWeights {
                    l1: 0.8,
                    dssim: 0.2,
                    mse: 0.0,
                    opacity: 0.01,
                    texture: 1e-8,
                    ..LossWeights::NONE
                },
                rates: RATES,
                accumulate_statistics: true,
            })
            .unwrap();
        assert!(report.loss.total.is_finite(), "{name}: {:?}", report.loss);
    }
    let after = backend.read_settled().unwrap();
    let spread = |before: &[f32], after: &[f32]| {
        before.iter().zip(after).filter(|(b, a)| b.is_finite() && !a.is_finite()).count()
    };
    let (b, a) = (&scene.model, &after);
    for group in litetex_gs::model::SplatGroup::ALL {
        assert_eq!(spread(b.splats.group(group), a.splats.group(group)), 0, "{name}: {group:?}");
    }
    assert_eq!(spread(&b.textures.texels, &a.textures.texels), 0, "{name}: texels");
    image.alpha.iter().map(|&a| f64::from(a)).sum()
}

fn scene(seed: u64) -> Scene {
    random_scene(&SceneOptions {
        num_splats: 200,
        width_px: 61,
        height_px: 43,
        seed,
        ..SceneOptions::default()
    })
}

#[test]
fn poisoned_splats_leave_picture_and_others_clean() {
    assert!(survives(&scene(1), "control") > 100.0);
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE / 2.0, 1e20, -1e20];
    for value in values {
        for group in litetex_gs::model::SplatGroup::ALL {
            let mut scene = scene(2);
            let width = group.width(3);
            for i in (0..200).step_by(3) {
                scene.model.splats.group_mut(group)[i * width + i % width] = value;
            }
            survives(&scene, &format!("{group:?} = {value}"));
        }
        let mut scene = scene(3);
        scene.model.textures.texels.iter_mut().step_by(7).for_each(|t| *t = value);
        survives(&scene, &format!("texels = {value}"));
    }
}

#[test]
fn degenerate_splats_are_survived() {
    let mut zero_quaternion = scene(4);
    zero_quaternion.model.splats.quaternions[..400].fill(0.0);
    survives(&zero_quaternion, "zero quaternion");
    let mut zero_area = scene(5);
    zero_area.model.splats.log_scales[..200].fill(-200.0);
    survives(&zero_area, "zero area");
    let mut inside = scene(6);
    let centre = inside.camera.centre_in_local();
    for i in 0..100 {
        (0..3).for_each(|k| inside.model.splats.positions[3 * i + k] = centre[k] as f32);
    }
    survives(&inside, "camera inside");
    let mut hidden = scene(7);
    hidden.model.splats.opacity_logits.fill(-50.0);
    assert_eq!(survives(&hidden, "nothing visible"), 0.0);
    let mut none =
        random_scene(&SceneOptions { num_splats: 0, width_px: 8, height_px: 8, ..SceneOptions::default() });
    assert_eq!(survives(&none, "no splat"), 0.0);
    none.model = scene(8).model;
    none.model.textures.maps.iter_mut().for_each(|m| m.texel_size = 0.0);
    survives(&none, "zero texel size");
}

#[test]
fn odd_picture_sizes_are_rendered() {
    for (w, h) in [(1, 1), (17, 13), (1, 300), (33, 2), (64, 64)] {
        let options = SceneOptions {
            num_splats: 300,
            width_px: w,
            height_px: h,
            scales: (0.1, 0.5),
            ..SceneOptions::default()
        };
        assert!(survives(&random_scene(&options), &format!("{w}x{h}")) > 0.0);
    }
}

#[test]
fn a_photo_of_another_size_is_a_usage_error() {
    let scene = scene(1);
    let mut backend = CpuBackend::new(Some(1)).unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let target = TargetImage { width_px: 3, height_px: 3, rgb: vec![0; 27], mask: None };
    let request = StepRequest {
        step: 1,
        camera: scene.camera,
        photo: 0,
        target: &target,
        background: [0.0; 3],
        sh_degree: 0,
        loss: LossWeights { l1: 1.0, dssim: 0.0, mse: 0.0, opacity: 0.0, texture: 0.0, ..LossWeights::NONE },
        rates: RATES,
        accumulate_statistics: false,
    };
    assert!(matches!(backend.step(&request), Err(Error::Usage(_))));
}
