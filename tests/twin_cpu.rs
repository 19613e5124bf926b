//! The CPU backend against the f64 reference: image, loss and every gradient on random scenes.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::twin::{
    Observed, WEIGHTS, agree, observe, reference, scenes, texels_flush_at_the_rate_of_their_map,
};
use litetex_gs::cpu::{CpuBackend, SimdLevel};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};

/// Largest rms error of the texel gradients, over the rms of the reference: needed 6e-4.
const TEXEL_RMS: f64 = 1e-3;

fn cpu(scene: &RandomScene, threads: usize) -> Observed {
    observe(&mut CpuBackend::new(Some(threads)).unwrap(), scene, &WEIGHTS)
}

#[test]
fn cpu_matches_the_reference() {
    for options in scenes() {
        let scene = random_scene(&options);
        println!("{options:?}");
        let expected = reference(&scene, &WEIGHTS);
        assert!(agree(&scene, &cpu(&scene, 2), &expected, TEXEL_RMS), "seed {}", options.seed);
    }
}

#[test]
fn every_instruction_set_matches_the_reference() {
    let scene = random_scene(&SceneOptions { num_splats: 1_000, ..scenes().remove(0) });
    let expected = reference(&scene, &WEIGHTS);
    for simd in SimdLevel::all() {
        let mut backend = CpuBackend::with_simd(Some(2), simd).unwrap();
        let got = observe(&mut backend, &scene, &WEIGHTS);
        assert!(agree(&scene, &got, &expected, TEXEL_RMS), "{}", simd.name());
    }
}

#[test]
fn a_small_change_of_the_scene_is_detected() {
    let options = SceneOptions { num_splats: 500, ..SceneOptions::default() };
    let mut scene = random_scene(&options);
    let expected = reference(&scene, &WEIGHTS);
    for logit in &mut scene.model.splats.opacity_logits {
        *logit += 0.01;
    }
    assert!(!agree(&scene, &cpu(&scene, 2), &expected, TEXEL_RMS));
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let scene = random_scene(&SceneOptions::default());
    assert_eq!(cpu(&scene, 1), cpu(&scene, 2));
}

#[test]
fn pending_texels_are_flushed_at_their_maps_rate() {
    assert!(texels_flush_at_the_rate_of_their_map(&mut CpuBackend::new(Some(2)).unwrap()));
}
