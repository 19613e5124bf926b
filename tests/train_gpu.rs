//! Training steps on the wgpu backend: compared with the CPU backend, repeated with other options, and interrupted by
//! renders and checkpoints.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::{backend, drivers_and_limits, open};
use common::steps::{differences, requests, scene, views};
use litetex_gs::backend::{Backend, LossWeights, RenderOptions, StepReport, StepRequest};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::gpu::{AdapterChoice, GpuBackend, GpuOptions, LimitChoice};
use litetex_gs::model::{AdamState, Model};
use litetex_gs::selftest::RandomScene;

type Trained = (Model, AdamState, Vec<StepReport>);

fn trained(backend: &mut dyn Backend, scene: &RandomScene, steps: u32) -> Trained {
    let views = views(scene);
    let requests = requests(&views, 1..=steps);
    trained_with(backend, scene, &requests)
}

fn trained_with(backend: &mut dyn Backend, scene: &RandomScene, requests: &[StepRequest<'_>]) -> Trained {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let reports = backend.steps(requests).unwrap();
    let (model, adam) = backend.read_back().unwrap();
    (model, adam, reports)
}

fn gpu(options: GpuOptions) -> Option<GpuBackend> {
    backend(options)
}

#[test]
fn ten_steps_follow_the_cpu_backend_on_every_driver() {
    drivers_and_limits()
        .iter()
        .for_each(|(driver, limits)| ten_steps_follow_the_cpu_backend(driver, *limits));
}

fn ten_steps_follow_the_cpu_backend(driver: &AdapterChoice, limits: LimitChoice) {
    let mut gpu = open(driver, limits, GpuOptions::default());
    let scene = scene(3);
    let (_, _, gpu_reports) = trained(&mut gpu, &scene, 10);
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let (_, _, cpu_reports) = trained(&mut cpu, &scene, 10);
    for (g, c) in gpu_reports.iter().zip(&cpu_reports) {
        assert!((g.loss.total / c.loss.total - 1.0).abs() < 1e-4, "{:?} {:?}", g.loss, c.loss);
        assert_eq!(g.non_finite_gradients, 0);
    }
    let (g, c) = (gpu.read_flushed().unwrap(), cpu.read_flushed().unwrap());
    for (group, difference) in differences(&scene.model, &g, &c) {
        println!("{} {group}: {difference:.2e}", driver.name);
        // Adam turns a tiny gradient into a full step, so that rounding of its sign shows: needed 7e-3.
        assert!(difference < 0.03, "{group}: {difference}");
    }
    let negative_control = differences(&scene.model, &scene.model, &c);
    assert!(negative_control.iter().all(|(_, d)| *d > 0.9), "{negative_control:?}");
}

#[test]
fn results_do_not_depend_on_batches_or_capacity() {
    let reference = GpuOptions::default();
    let variants = [
        reference,
        // Overflows in the first step, and again as more splats become visible.
        GpuOptions { pair_capacity: Some(50), ..reference },
        GpuOptions { batch_steps: Some(1), ..reference },
        GpuOptions { batch_steps: Some(16), ..reference },
        GpuOptions { pair_capacity: Some(50), batch_steps: Some(3), ..reference },
    ];
    let scene = scene(5);
    let mut first: Option<(Model, AdamState, Vec<StepReport>)> = None;
    // Default batches adapt to the device's speed, and so differ from run to run.
    for options in variants {
        let Some(mut backend) = gpu(options) else { return };
        let run = trained(&mut backend, &scene, 21);
        let statistics = backend.read_statistics().unwrap();
        assert_eq!(statistics.views, 7);
        match &first {
            Some(first) => assert!(*first == run, "{options:?}"),
            None => first = Some(run),
        }
    }
    let Some(mut backend) = gpu(reference) else { return };
    let different = trained(&mut backend, &common::steps::scene(6), 21);
    assert!(first.unwrap().0 != different.0, "negative control: another scene gives another model");
}

/// Steps of every kind: with statistics, with terms on depths and normals.
fn mixed<'a>(
    views: &'a [(litetex_gs::camera::Camera, litetex_gs::backend::TargetImage)],
) -> Vec<StepRequest<'a>> {
    let mut out = requests(views, 1..=14);
    for request in &mut out {
        let loss = request.loss;
        request.loss = match request.step % 4 {
            0 => LossWeights { distortion: 10.0, normal: 0.05, ..loss },
            2 => LossWeights { normal: 0.1, ..loss },
            _ => loss,
        };
    }
    out
}

#[test]
fn steps_of_every_kind_are_repeated_bit_for_bit_with_both_kernel_variants() {
    // Large maps, so that some texel gradients are added tap by tap.
    let scene = litetex_gs::selftest::random_scene(&litetex_gs::selftest::SceneOptions {
        num_splats: 300,
        scales: (0.02, 0.15),
        opacities: (0.05, 0.8),
        map_sizes: vec![(40, 40), (4, 4), (9, 5)],
        width_px: 83,
        height_px: 61,
        seed: 21,
        ..Default::default()
    });
    let views = views(&scene);
    let mut models = Vec::new();
    for hardware in [true, false] {
        let plain = GpuOptions { hardware_kernels: Some(hardware), ..GpuOptions::default() };
        let variants = [
            GpuOptions { batch_steps: Some(1), ..plain },
            GpuOptions { batch_steps: Some(16), ..plain },
            GpuOptions { batch_steps: Some(16), pair_capacity: Some(50), ..plain },
            GpuOptions { pair_capacity: Some(50), ..plain },
            GpuOptions { unchecked_indices: Some(false), ..plain },
            GpuOptions { unchecked_indices: Some(true), ..plain },
        ];
        let runs = variants.map(|options| {
            let mut backend = gpu(options)?;
            let run = trained_with(&mut backend, &scene, &mixed(&views));
            Some((run, backend.read_statistics().unwrap()))
        });
        for (options, run) in variants.iter().zip(&runs) {
            let Some(run) = run else { return };
            assert!(Some(run) == runs[0].as_ref(), "{options:?}");
        }
        let Some(((model, _, reports), statistics)) = runs.into_iter().flatten().next() else { return };
        assert!(reports.iter().any(|r| r.loss.distortion > 0.0 && r.loss.normal > 0.0));
        assert_eq!(statistics.views, 4);
        models.push(model);
    }
    assert!(models[0] != models[1], "results of different variants differ in their last bits");
}

#[test]
fn rendering_during_training_does_not_change_it() {
    let Some(mut backend) = gpu(GpuOptions::default()) else { return };
    let scene = scene(7);
    let views = views(&scene);
    let (expected, expected_adam, _) = trained(&mut backend, &scene, 12);
    let flushed = backend.read_flushed().unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let options = RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false };
    let mut flushed_then = None;
    for request in requests(&views, 1..=12) {
        backend.step(&request).unwrap();
        for (camera, _) in &views {
            backend.render(camera, &options).unwrap();
        }
        flushed_then = Some(backend.read_flushed().unwrap());
    }
    let (model, adam) = backend.read_back().unwrap();
    assert!(model == expected && adam == expected_adam);
    assert!(flushed_then.unwrap() == flushed && flushed != expected, "nothing lagged, or flushing differs");
}

#[test]
fn an_image_shows_the_flushed_model() {
    let Some(mut backend) = gpu(GpuOptions::default()) else { return };
    let scene = scene(8);
    trained(&mut backend, &scene, 12);
    let options = RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false };
    let lagging = backend.render(&scene.camera, &options).unwrap();
    let flushed = backend.read_flushed().unwrap();
    backend.upload(&flushed, &AdamState::zeros(&flushed)).unwrap();
    assert_eq!(lagging, backend.render(&scene.camera, &options).unwrap());
}

#[test]
fn training_continues_bit_for_bit_from_the_state_read_back() {
    let Some(mut backend) = gpu(GpuOptions::default()) else { return };
    let scene = scene(9);
    let views = views(&scene);
    let (expected, expected_adam, _) = trained(&mut backend, &scene, 14);
    let (model, adam, _) = trained(&mut backend, &scene, 6);
    let mut other = gpu(GpuOptions::default()).unwrap();
    other.upload(&model, &adam).unwrap();
    other.steps(&requests(&views, 7..=14)).unwrap();
    let (model, adam) = other.read_back().unwrap();
    assert!(model == expected && adam == expected_adam);
}
