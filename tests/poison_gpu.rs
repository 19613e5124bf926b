//! Poisoned input and failing devices on the wgpu backend.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::backend;
use common::poison::{self, RATES, scene};
use litetex_gs::Error;
use litetex_gs::backend::{Backend as _, LossWeights, RenderOptions, StepRequest, TargetImage};
use litetex_gs::gpu::GpuOptions;
use litetex_gs::model::{AdamState, TextureMap, TexturePool};

#[test]
fn poisoned_splats_do_not_affect_the_image_or_other_splats() {
    let Some(mut backend) = backend(GpuOptions::default()) else { return };
    poison::poisoned_splats_do_not_affect_the_image_or_other_splats(&mut backend);
}

#[test]
fn degenerate_splats_do_no_harm() {
    let Some(mut backend) = backend(GpuOptions::default()) else { return };
    poison::degenerate_splats_do_no_harm(&mut backend);
}

#[test]
fn odd_image_sizes_are_rendered() {
    let Some(mut backend) = backend(GpuOptions::default()) else { return };
    poison::odd_image_sizes_are_rendered(&mut backend);
}

fn request<'a>(scene: &'a litetex_gs::selftest::RandomScene, target: &'a TargetImage) -> StepRequest<'a> {
    StepRequest {
        step: 1,
        camera: scene.camera,
        photo: None,
        target,
        background: [0.0; 3],
        sh_degree: 0,
        loss: LossWeights { l1: 1.0, ..LossWeights::NONE },
        rates: RATES,
        accumulate_statistics: false,
        exposure: None,
    }
}

#[test]
fn a_photo_of_another_size_is_a_usage_error() {
    let Some(mut backend) = backend(GpuOptions::default()) else { return };
    let scene = scene(1);
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let target = TargetImage::opaque(3, 3, vec![0; 27]);
    let error = backend.step(&request(&scene, &target)).unwrap_err();
    assert!(matches!(error, Error::Usage(_)), "{error}");
    assert!(backend.step(&request(&scene, &scene.target)).is_ok(), "the backend still works");
}

#[test]
fn a_lost_device_is_a_typed_error_everywhere() {
    let Some(mut backend) = backend(GpuOptions::default()) else { return };
    let scene = scene(1);
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    backend.step(&request(&scene, &scene.target)).unwrap();
    backend.lose_device();
    let options = RenderOptions { background: [0.0; 3], sh_degree: 0, geometry: false };
    let plan = litetex_gs::backend::DensityPlan {
        sources: vec![0],
        maps: vec![litetex_gs::backend::MapChange::Keep],
        ..Default::default()
    };
    let errors = [
        backend.step(&StepRequest { step: 2, ..request(&scene, &scene.target) }).err(),
        backend.render(&scene.camera, &options).err(),
        backend.read_back().err(),
        backend.read_flushed().err(),
        backend.read_statistics().err(),
        backend.apply_plan(&plan).err(),
        backend.upload(&scene.model, &AdamState::zeros(&scene.model)).err(),
    ];
    for (k, error) in errors.into_iter().enumerate() {
        let error = error.unwrap_or_else(|| panic!("call {k} succeeded"));
        assert!(matches!(error, Error::Device(_)) && error.exit_code() == 5, "call {k}: {error}");
    }
}

#[test]
fn a_scene_beyond_the_limits_is_refused_with_sizes() {
    let Some(driver) = common::gpu::drivers().into_iter().next() else { return };
    let mut backend =
        common::gpu::open(&driver, litetex_gs::gpu::LimitChoice::Downlevel, GpuOptions::default());
    let small = scene(1);
    let mut large = small.model.clone();
    // 600,000 splats of 58 floats: 132.8 MiB.
    let sources: Vec<u32> = (0..600_000).map(|i| i % 200).collect();
    large.splats = large.splats.gathered(&sources, vec![3; sources.len()]);
    large.textures = TexturePool::neutral(vec![TextureMap::default(); 600_000]).unwrap();
    let error = backend.upload(&large, &AdamState::zeros(&large)).unwrap_err();
    assert!(matches!(error, Error::DeviceFull(_)), "{error}");
    let text = error.to_string();
    assert!(text.contains("34800000 x 4 bytes = 132.8 MiB") && text.contains("128.0 MiB"), "{text}");
    backend.upload(&small.model, &AdamState::zeros(&small.model)).unwrap();
    backend.step(&request(&small, &small.target)).unwrap();
}
