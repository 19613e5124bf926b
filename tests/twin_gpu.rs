//! The wgpu backend against the f64 reference, on every software driver that is installed and within the lowest
//! limits that it may meet.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::{backend, drivers, open};
use common::twin::{WEIGHTS, agree, observe, reference, scenes};
use litetex_gs::backend::LossWeights;
use litetex_gs::gpu::{GpuOptions, Limits};
use litetex_gs::selftest::{SceneOptions, random_scene};

/// Limit of the texels' gradients, rms over that of the reference.
const TEXEL_RMS: f64 = 1e-3;

const NO_GEOMETRY: LossWeights = LossWeights { distortion: 0.0, normal: 0.0, ..WEIGHTS };

#[test]
fn gpu_matches_the_reference_on_every_driver() {
    for driver in drivers() {
        let mut backend = open(&driver, Limits::Downlevel, GpuOptions::default());
        for options in scenes() {
            let scene = random_scene(&options);
            println!("{} {options:?}", driver.name);
            let got = observe(&mut backend, &scene, &NO_GEOMETRY);
            let expected = reference(&scene, &NO_GEOMETRY);
            assert!(agree(&scene, &got, &expected, TEXEL_RMS), "{}, seed {}", driver.name, options.seed);
        }
    }
}

#[test]
fn the_kernels_for_hardware_match_the_reference_too() {
    // The scene with maps that are finer than the pixels, and a common one.
    for options in [scenes().swap_remove(3), scenes().swap_remove(0)] {
        let options = SceneOptions { num_splats: 600, ..options };
        let scene = random_scene(&options);
        let expected = reference(&scene, &NO_GEOMETRY);
        let observed = [true, false].map(|hardware| {
            let options =
                GpuOptions { hardware_kernels: Some(hardware), count_pairs: true, ..GpuOptions::default() };
            backend(options).map(|mut b| observe(&mut b, &scene, &NO_GEOMETRY))
        });
        let [Some(hardware), Some(software)] = observed else { return };
        assert!(agree(&scene, &hardware, &expected, TEXEL_RMS), "seed {}", options.seed);
        assert_eq!(hardware.image, software.image);
    }
}

#[test]
fn a_small_change_of_the_scene_is_noticed() {
    let Some(mut backend) = backend(GpuOptions::default()) else { return };
    let mut scene = random_scene(&SceneOptions { num_splats: 500, ..SceneOptions::default() });
    let expected = reference(&scene, &NO_GEOMETRY);
    for logit in &mut scene.model.splats.opacity_logits {
        *logit += 0.01;
    }
    let got = observe(&mut backend, &scene, &NO_GEOMETRY);
    assert!(!agree(&scene, &got, &expected, TEXEL_RMS));
}
