//! Poisoned input on the CPU backend gives a clean image and clean gradients, or a typed error.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::poison::{self, RATES, scene};
use litetex_gs::Error;
use litetex_gs::backend::{Backend as _, LossWeights, StepRequest, TargetImage};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::AdamState;

#[test]
fn poisoned_splats_do_not_affect_the_image_or_other_splats() {
    poison::poisoned_splats_do_not_affect_the_image_or_other_splats(&mut CpuBackend::new(Some(2)).unwrap());
}

#[test]
fn degenerate_splats_do_no_harm() {
    poison::degenerate_splats_do_no_harm(&mut CpuBackend::new(Some(2)).unwrap());
}

#[test]
fn odd_image_sizes_are_rendered() {
    poison::odd_image_sizes_are_rendered(&mut CpuBackend::new(Some(2)).unwrap());
}

#[test]
fn a_photo_of_another_size_is_a_usage_error() {
    let scene = scene(1);
    let mut backend = CpuBackend::new(Some(1)).unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let target = TargetImage::opaque(3, 3, vec![0; 27]);
    let request = StepRequest {
        step: 1,
        camera: scene.camera,
        photo: None,
        target: &target,
        background: [0.0; 3],
        sh_degree: 0,
        loss: LossWeights { l1: 1.0, dssim: 0.0, mse: 0.0, opacity: 0.0, texture: 0.0, ..LossWeights::NONE },
        rates: RATES,
        accumulate_statistics: false,
        exposure: None,
    };
    assert!(matches!(backend.step(&request), Err(Error::Usage(_))));
}
