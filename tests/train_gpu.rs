//! Steps on the wgpu backend: against the CPU backend, against itself, and across what a run does in between.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::{backend, drivers_and_limits, open};
use common::steps::{plan, requests, scene, views};
use litetex_gs::backend::{Backend, LossWeights, RenderOptions, StepReport, StepRequest};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::gpu::{AdapterChoice, GpuBackend, GpuOptions, Limits};
use litetex_gs::model::{AdamState, Model, SplatGroup};
use litetex_gs::selftest::Scene;

type Trained = (Model, AdamState, Vec<StepReport>);

fn trained(backend: &mut dyn Backend, scene: &Scene, steps: u32) -> Trained {
    let views = views(scene);
    let requests = requests(&views, 1..=steps);
    trained_with(backend, scene, &requests)
}

fn trained_with(backend: &mut dyn Backend, scene: &Scene, requests: &[StepRequest<'_>]) -> Trained {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let reports = backend.steps(requests).unwrap();
    let (model, adam) = backend.read_back().unwrap();
    (model, adam, reports)
}

fn gpu(options: GpuOptions) -> Option<GpuBackend> {
    backend(options)
}

/// Change of every group over the run: root mean square of the difference over that of the change.
fn differences(start: &Model, a: &Model, b: &Model) -> Vec<(String, f64)> {
    let difference = |start: &[f32], a: &[f32], b: &[f32]| {
        let square =
            |x: &[f32], y: &[f32]| x.iter().zip(y).map(|(x, y)| f64::from(x - y).powi(2)).sum::<f64>();
        (square(a, b) / square(start, b)).sqrt()
    };
    let mut out: Vec<(String, f64)> = SplatGroup::ALL
        .into_iter()
        .map(|g| (format!("{g:?}"), difference(start.splats.group(g), a.splats.group(g), b.splats.group(g))))
        .collect();
    let texels = difference(&start.textures.texels, &a.textures.texels, &b.textures.texels);
    out.push(("Texel".into(), texels));
    out
}

#[test]
fn ten_steps_follow_the_cpu_backend_on_every_driver() {
    drivers_and_limits()
        .iter()
        .for_each(|(driver, limits)| ten_steps_follow_the_cpu_backend(driver, *limits));
}

fn ten_steps_follow_the_cpu_backend(driver: &AdapterChoice, limits: Limits) {
    let mut gpu = open(driver, limits, GpuOptions::default());
    let scene = scene(3);
    let (_, _, gpu_reports) = trained(&mut gpu, &scene, 10);
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let (_, _, cpu_reports) = trained(&mut cpu, &scene, 10);
    for (g, c) in gpu_reports.iter().zip(&cpu_reports) {
        assert!((g.loss.total / c.loss.total - 1.0).abs() < 1e-4, "{:?} {:?}", g.loss, c.loss);
        assert_eq!(g.non_finite_gradients, 0);
    }
    let (g, c) = (gpu.read_settled().unwrap(), cpu.read_settled().unwrap());
    for (group, difference) in differences(&scene.model, &g, &c) {
        println!("{} {group}: {difference:.2e}", driver.name);
        // Adam turns the sign of a tiny gradient into a full step, so that rounding shows: needed 7e-3.
        assert!(difference < 0.03, "{group}: {difference}");
    }
    let negative_control = differences(&scene.model, &scene.model, &c);
    assert!(negative_control.iter().all(|(_, d)| *d > 0.9), "{negative_control:?}");
}

#[test]
fn neither_batches_nor_capacity_nor_reruns_change_a_bit_on_any_driver() {
    for (driver, limits) in drivers_and_limits() {
        neither_batches_nor_capacity_nor_reruns_change_a_bit(&driver, limits);
    }
}

fn neither_batches_nor_capacity_nor_reruns_change_a_bit(driver: &AdapterChoice, limits: Limits) {
    let reference = GpuOptions::default();
    let variants = [
        reference,
        // Overflows at once, and again as splats come into sight.
        GpuOptions { pair_capacity: Some(50), ..reference },
        GpuOptions { batch_steps: Some(1), ..reference },
        GpuOptions { batch_steps: Some(16), ..reference },
        GpuOptions { pair_capacity: Some(50), batch_steps: Some(3), ..reference },
    ];
    let scene = scene(5);
    let mut first: Option<(Model, AdamState, Vec<StepReport>)> = None;
    // Batches of the default follow the device's speed, and so are other ones each time. The slower drivers get
    // the first two.
    let count = if driver.name == "lavapipe" { variants.len() } else { 2 };
    for options in variants.into_iter().take(count) {
        let mut backend = open(driver, limits, options);
        let run = trained(&mut backend, &scene, 21);
        let statistics = backend.read_statistics().unwrap();
        assert_eq!(statistics.views, 7);
        match &first {
            Some(first) => assert!(*first == run, "{} {options:?}", driver.name),
            None => first = Some(run),
        }
    }
    let other = GpuOptions::default();
    let different = trained(&mut open(driver, limits, other), &common::steps::scene(6), 21);
    assert!(first.unwrap().0 != different.0, "another scene gives another model");
}

/// Steps of every kind: with statistics, with hidden textures, with terms on depths and normals.
fn mixed<'a>(
    views: &'a [(litetex_gs::camera::Camera, litetex_gs::backend::TargetImage)],
) -> Vec<StepRequest<'a>> {
    let mut out = requests(views, 1..=14);
    for request in &mut out {
        let loss = request.loss;
        request.loss = match request.step % 4 {
            0 => LossWeights { distortion: 10.0, normal: 0.05, ..loss },
            1 => LossWeights { texture_hidden: 1e-6, ..loss },
            2 => LossWeights { normal: 0.1, texture_hidden: 1e-6, ..loss },
            _ => loss,
        };
    }
    out
}

#[test]
fn steps_of_every_kind_are_skipped_and_replayed_bit_for_bit_by_the_kernels_for_hardware_too() {
    // Large maps, so that texels are added tap by tap as well.
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
    assert!(models[0] != models[1], "the forms differ in their last bits: each was run");
}

#[test]
fn looking_does_not_change_a_bit() {
    let Some(mut backend) = gpu(GpuOptions::default()) else { return };
    let scene = scene(7);
    let views = views(&scene);
    let (expected, expected_adam, _) = trained(&mut backend, &scene, 12);
    let settled = backend.read_settled().unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let options = RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false };
    let mut settled_then = None;
    for request in requests(&views, 1..=12) {
        backend.step(&request).unwrap();
        for (camera, _) in &views {
            backend.render(camera, &options).unwrap();
        }
        settled_then = Some(backend.read_settled().unwrap());
    }
    let (model, adam) = backend.read_back().unwrap();
    assert!(model == expected && adam == expected_adam);
    assert!(settled_then.unwrap() == settled && settled != expected, "something lagged");
}

#[test]
fn a_picture_shows_the_settled_model() {
    let Some(mut backend) = gpu(GpuOptions::default()) else { return };
    let scene = scene(8);
    trained(&mut backend, &scene, 12);
    let options = RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false };
    let lagging = backend.render(&scene.camera, &options).unwrap();
    let settled = backend.read_settled().unwrap();
    backend.upload(&settled, &AdamState::zeros(&settled)).unwrap();
    assert_eq!(lagging, backend.render(&scene.camera, &options).unwrap());
}

#[test]
fn a_run_continues_bit_for_bit_from_what_was_read_back() {
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

#[test]
fn plans_are_applied_as_on_the_cpu_on_every_driver() {
    drivers_and_limits().iter().for_each(|(driver, limits)| plans_are_applied_as_on_the_cpu(driver, *limits));
}

fn plans_are_applied_as_on_the_cpu(driver: &AdapterChoice, limits: Limits) {
    let mut gpu = open(driver, limits, GpuOptions::default());
    let scene = scene(10);
    let (model, adam, _) = trained(&mut gpu, &scene, 9);
    let plan = plan(model.num_splats());
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let mut results = Vec::new();
    for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
        backend.upload(&model, &adam).unwrap();
        backend.apply_plan(&plan).unwrap();
        let applied = backend.read_back().unwrap();
        // The new structure is trained on.
        let views = views(&scene);
        backend.steps(&requests(&views, 10..=12)).unwrap();
        results.push((applied, backend.read_back().unwrap()));
    }
    let [(gpu, gpu_later), (cpu, cpu_later)] = results.try_into().ok().unwrap();
    assert_eq!(gpu.0.textures.maps, cpu.0.textures.maps);
    assert_eq!(gpu.1.last_step, cpu.1.last_step);
    let close = |a: &[f32], b: &[f32], limit: f32| {
        assert_eq!(a.len(), b.len());
        let largest = b.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= limit * largest)
    };
    for group in SplatGroup::ALL {
        assert!(close(gpu.0.splats.group(group), cpu.0.splats.group(group), 1e-6), "{group:?}");
        assert!(close(gpu.1.splats_m.group(group), cpu.1.splats_m.group(group), 2e-6), "m {group:?}");
        assert!(close(gpu.1.splats_v.group(group), cpu.1.splats_v.group(group), 2e-6), "v {group:?}");
    }
    assert!(close(&gpu.0.textures.texels, &cpu.0.textures.texels, 2e-6));
    assert!(close(&gpu.1.texels_m, &cpu.1.texels_m, 2e-6));
    assert!(close(&gpu.1.texels_v, &cpu.1.texels_v, 2e-6));
    assert!(!close(&gpu_later.0.textures.texels, &gpu.0.textures.texels, 1e-4), "texels were trained on");
    assert_eq!(gpu_later.0.num_texels(), cpu_later.0.num_texels());
}
