//! Steps on the wgpu backend: against the CPU backend, against itself, and across what a run does in between.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::backend;
use litetex_gs::backend::{
    Backend, LearningRates, LossWeights, MapChange, RenderOptions, StepReport, StepRequest, StructurePlan,
    TargetImage,
};
use litetex_gs::camera::{Camera, RigidTransform};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::gpu::{GpuBackend, GpuOptions};
use litetex_gs::model::{AdamState, Model, SplatGroup};
use litetex_gs::selftest::{Scene, SceneOptions, random_scene};

const RATES: LearningRates = LearningRates {
    position: 2e-4,
    quaternion: 1e-3,
    log_scale: 5e-3,
    opacity: 0.02,
    sh_dc: 2.5e-3,
    sh_rest: 1.25e-4,
    texel: 2e-3,
};

fn scene(seed: u64) -> Scene {
    random_scene(&SceneOptions {
        num_splats: 600,
        scales: (0.02, 0.15),
        opacities: (0.05, 0.8),
        width_px: 83,
        height_px: 61,
        seed,
        ..SceneOptions::default()
    })
}

/// The scene from a few sides and in two sizes: splats come into sight and leave it, and lag behind.
fn views(scene: &Scene) -> Vec<(Camera, TargetImage)> {
    let turned = |k: usize| {
        let angle = (k as f64 - 2.0) * 0.35;
        let turn = glam::DMat3::from_rotation_y(angle);
        let pose = scene.camera.camera_from_local;
        let camera_from_local =
            RigidTransform { rotation: turn * pose.rotation, translation: turn * pose.translation };
        let camera = Camera { camera_from_local, ..scene.camera };
        if k % 2 == 0 {
            return (camera, scene.target.clone());
        }
        let (w, h) = (40, 33);
        let rgb = (0..3 * w * h).map(|i| (i * 37 % 251) as u8).collect();
        (camera.resized(w, h), TargetImage { width_px: w, height_px: h, rgb, mask: None })
    };
    (0..5).map(turned).collect()
}

fn requests(views: &[(Camera, TargetImage)], steps: std::ops::RangeInclusive<u32>) -> Vec<StepRequest<'_>> {
    let request = |step: u32| {
        let view = step as usize * 3 % views.len();
        StepRequest {
            step,
            camera: views[view].0,
            photo: view as u32,
            target: &views[view].1,
            background: [0.1, 0.2, 0.3],
            sh_degree: (step / 8).min(3),
            loss: LossWeights { mse: 0.03, ..LossWeights::default() },
            rates: RATES,
            accumulate_statistics: step.is_multiple_of(3),
        }
    };
    steps.map(request).collect()
}

fn trained(backend: &mut dyn Backend, scene: &Scene, steps: u32) -> (Model, AdamState, Vec<StepReport>) {
    let views = views(scene);
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let reports = backend.steps(&requests(&views, 1..=steps)).unwrap();
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
fn ten_steps_follow_the_cpu_backend() {
    let Some(mut gpu) = gpu(GpuOptions::default()) else { return };
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
        println!("{group}: {difference:.2e}");
        // Adam turns the sign of a tiny gradient into a full step, so that rounding shows.
        assert!(difference < 0.1, "{group}: {difference}");
    }
    let negative_control = differences(&scene.model, &scene.model, &c);
    assert!(negative_control.iter().all(|(_, d)| *d > 0.9), "{negative_control:?}");
}

#[test]
fn neither_batches_nor_capacity_nor_reruns_change_a_bit() {
    let reference = GpuOptions::default();
    let variants = [
        reference,
        GpuOptions { batch_steps: 1, ..reference },
        // Overflows at once, and again as splats come into sight.
        GpuOptions { pair_capacity: Some(50), ..reference },
        GpuOptions { pair_capacity: Some(50), batch_steps: 1, ..reference },
    ];
    let scene = scene(5);
    let mut first: Option<(Model, AdamState, Vec<StepReport>)> = None;
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
    let other = GpuOptions::default();
    let different = trained(&mut gpu(other).unwrap(), &self::scene(6), 21);
    assert!(first.unwrap().0 != different.0, "another scene gives another model");
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

/// Every fourth splat goes, every seventh comes twice, maps are kept, enlarged, shrunk or dropped.
fn plan(num_splats: usize) -> StructurePlan {
    let mut plan = StructurePlan { sources: Vec::new(), maps: Vec::new() };
    for i in (0..num_splats).filter(|i| i % 4 != 0) {
        for copy in 0..1 + usize::from(i % 7 == 0) {
            let resample = |rows, cols, texel_size| MapChange::Resample {
                rows,
                cols,
                texel_size,
                moment_scale: [0.25, 0.0625],
            };
            plan.sources.push(i as u32);
            plan.maps.push(match (i + copy) % 4 {
                0 => resample(9, 4, 0.02),
                1 => resample(0, 0, 0.1),
                2 => resample(2, 3, 0.2),
                _ => MapChange::Keep,
            });
        }
    }
    plan
}

#[test]
fn plans_are_applied_as_on_the_cpu() {
    let Some(mut gpu) = gpu(GpuOptions::default()) else { return };
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
