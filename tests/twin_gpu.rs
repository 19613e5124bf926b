//! The wgpu backend against the f64 reference and the CPU backend, on every software driver that is installed.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::twin::{Observed, WEIGHTS, agree, observe, reference, scenes};
use litetex_gs::backend::LossWeights;
use litetex_gs::gpu::{GpuBackend, GpuDevice, GpuOptions, Limits, list_adapters};
use litetex_gs::selftest::{Scene, SceneOptions, random_scene};

/// Limit of the texels' gradients, rms over that of the reference.
const TEXEL_RMS: f64 = 1e-3;

/// Backends on all software drivers within the given limits; says so where there is none.
fn backends(limits: Limits, options: GpuOptions) -> Vec<GpuBackend> {
    let software: Vec<_> = list_adapters().into_iter().filter(|a| !a.hardware).collect();
    assert!(
        software.len() >= 2 || std::env::var_os("LITETEX_REQUIRE_GPU").is_none(),
        "two software drivers are required, there is {software:?}"
    );
    if software.is_empty() {
        println!("skipped: no software Vulkan driver is installed");
    }
    let open = |a| GpuBackend::new(GpuDevice::open(a, limits).unwrap(), options).unwrap();
    software.iter().map(open).collect()
}

#[test]
fn gpu_matches_the_reference() {
    let weights = LossWeights { distortion: 0.0, normal: 0.0, ..WEIGHTS };
    for mut backend in backends(Limits::Downlevel, GpuOptions::default()) {
        for options in scenes() {
            let scene = random_scene(&options);
            println!("{options:?}");
            let got = observe(&mut backend, &scene, &weights);
            assert!(agree(&scene, &got, &reference(&scene, &weights), TEXEL_RMS), "seed {}", options.seed);
        }
    }
}
