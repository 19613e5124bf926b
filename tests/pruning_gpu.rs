//! What rounds of pruning ask of a GPU: costs, errors and saved states as on the CPU, and little that the host waits for.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::{backend, backends};
use common::steps::{requests, views};
use common::training::{config, damaged, photos, scene};
use glam::{DQuat, Vec3};
use litetex_gs::backend::{Backend, ColourMap, ComparedView, Costs, Probe};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::gpu::{DeviceWork, GpuOptions};
use litetex_gs::model::{AdamState, Model};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};
use litetex_gs::train::density::DensityConfig;
use litetex_gs::train::{Control, Policy, Pruned, TrainConfig, TrainEvent, TrainState, train};

/// Room for the statuses of the steps before a round: less than what costs of a splat take.
const STATUS_BYTES: usize = 8 << 10;

/// Maps of every shape: odd and even, one texel, one row, none.
fn varied() -> RandomScene {
    let map_sizes = vec![(4, 4), (8, 6), (2, 5), (1, 1), (7, 3), (1, 6), (0, 0), (20, 9)];
    random_scene(&SceneOptions {
        num_splats: 80,
        map_sizes,
        width_px: 64,
        height_px: 48,
        scales: (0.05, 0.2),
        opacities: (0.3, 0.999),
        depths: (0.8, 2.0),
        ..SceneOptions::default()
    })
}

fn costs(backend: &mut dyn Backend, scene: &RandomScene, first_seed: u64) -> Vec<Costs> {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let probe = |seed| Ok(Probe::new(scene.camera, &scene.target, [0.2; 3], 3, seed));
    backend.probe(&mut (first_seed..first_seed + 20).map(probe)).unwrap()
}

/// All costs of a splat, in the same order for each.
fn numbers(costs: &Costs) -> Vec<f64> {
    let mut all = vec![f64::from(costs.seen), costs.removal, costs.colour, costs.map];
    all.extend(costs.degrees.iter().chain(&costs.coarser));
    all.extend(costs.crops.as_flattened().as_flattened());
    all
}

/// Largest difference of any kind of cost, over the root mean square of its kind.
fn difference(a: &[Costs], b: &[Costs]) -> f64 {
    let [a, b] = [a, b].map(|costs| costs.iter().map(numbers).collect::<Vec<_>>());
    let of_kind = |kind: usize| {
        let squares = b.iter().map(|costs| costs[kind].powi(2)).sum::<f64>();
        assert!(squares > 0.0, "kind {kind} costs nothing");
        let largest = a.iter().zip(&b).map(|(a, b)| (a[kind] - b[kind]).abs()).fold(0.0, f64::max);
        largest / (squares / b.len() as f64).sqrt()
    };
    (0..b[0].len()).map(of_kind).fold(0.0, f64::max)
}

#[test]
fn parts_of_splats_cost_the_same_on_every_driver() {
    let scene = varied();
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let expected = costs(&mut cpu, &scene, 0);
    let hardware =
        GpuOptions { hardware_kernels: Some(true), unchecked_indices: Some(true), ..GpuOptions::default() };
    for (options, num_drivers) in [(GpuOptions::default(), usize::MAX), (hardware, 1)] {
        for mut gpu in backends(options).take(num_drivers) {
            let got = costs(&mut gpu, &scene, 0);
            let off = difference(&got, &expected);
            println!("{off:.1e}");
            // Needed 5.5e-5: sums in f32.
            assert!(off < 2e-4, "{off:e}");
            // The same again, whatever was there before.
            assert!(costs(&mut gpu, &scene, 0) == got);
            // Negative control: other signs.
            assert!(difference(&costs(&mut gpu, &scene, 20), &expected) > 0.1);
        }
    }
}

#[test]
fn squared_errors_are_those_of_the_images() {
    let scene = varied();
    let mut masked = scene.target.clone();
    masked.mask = Some((0..64 * 48).map(|i| u8::from(i % 7 != 0)).collect());
    let brighter = ColourMap([[1.2, 0.0, 0.1, 0.0], [0.0, 1.1, 0.0, 0.05], [0.0, 0.0, 0.9, 0.0]]);
    let compared = |photo, target, exposure| ComparedView {
        camera: scene.camera,
        photo: Some(photo),
        target,
        background: [0.2; 3],
        sh_degree: 3,
        exposure,
    };
    let views = [
        compared(0, &scene.target, None),
        compared(1, &masked, None),
        compared(0, &scene.target, Some(brighter)),
    ];
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    cpu.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let expected = cpu.squared_errors(&views).unwrap();
    if let Some(mut gpu) = backend(GpuOptions::default()) {
        gpu.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        // Each splat lags behind, so that it is flushed for the image, but not for good.
        gpu.steps(&requests(&self::views(&scene), 1..=3)).unwrap();
        let before = gpu.read_back().unwrap();
        gpu.squared_errors(&views).unwrap();
        assert!(gpu.read_back().unwrap() == before, "comparing moves nothing");

        gpu.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        let got = gpu.squared_errors(&views).unwrap();
        println!("{got:?}, expected {expected:?}");
        for (got, expected) in got.iter().zip(&expected) {
            // Needed 1e-6: sums in f32.
            assert!((got / expected - 1.0).abs() < 1e-5);
        }
        // Negative control: the mask counts.
        assert!((got[0] / got[1] - 1.0).abs() > 1e-2);
    }
}

/// Whether a run goes on from a saved state with the same bits, whatever happened in between.
fn returns_to_saved_states(backend: &mut dyn Backend) {
    let scene = varied();
    let views = views(&scene);
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    backend.steps(&requests(&views, 1..=4)).unwrap();
    let saved = backend.save().unwrap();
    backend.steps(&requests(&views, 5..=9)).unwrap();
    let straight = backend.read_back().unwrap();
    let start = damaged(&scene);
    backend.upload(&start, &AdamState::zeros(&start)).unwrap();
    backend.steps(&requests(&views, 1..=2)).unwrap();
    for _ in 0..2 {
        backend.restore(&saved).unwrap();
        backend.steps(&requests(&views, 5..=9)).unwrap();
        assert!(backend.read_back().unwrap() == straight);
    }
    // Negative control: without the state.
    backend.steps(&requests(&views, 5..=9)).unwrap();
    assert!(backend.read_back().unwrap() != straight);
}

#[test]
fn runs_go_on_from_saved_states() {
    returns_to_saved_states(&mut CpuBackend::new(Some(2)).unwrap());
    if let Some(mut gpu) = backend(GpuOptions::default()) {
        returns_to_saved_states(&mut gpu);
    }
}

#[test]
fn states_of_other_backends_are_refused() {
    let scene = varied();
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    cpu.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let saved = cpu.save().unwrap();
    if let Some(mut gpu) = backend(GpuOptions::default()) {
        gpu.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        assert!(gpu.restore(&saved).unwrap_err().to_string().contains("another backend"));
        assert!(cpu.restore(&gpu.save().unwrap()).unwrap_err().to_string().contains("another backend"));
    }
}

/// Work between two readings of a device's counters.
fn between(before: DeviceWork, after: DeviceWork) -> DeviceWork {
    DeviceWork {
        dispatches: after.dispatches - before.dispatches,
        submissions: after.submissions - before.submissions,
        overlapping: after.overlapping - before.overlapping,
        waits: after.waits - before.waits,
        uploads: after.uploads - before.uploads,
        photos: after.photos - before.photos,
        read_bytes: after.read_bytes - before.read_bytes,
    }
}

/// Work of the batches of steps after which a run prunes, with that of the density-control step between.
fn rounds(start: &Model, floor_db: f64) -> Option<Vec<(Pruned, DeviceWork)>> {
    let mut gpu = backend(GpuOptions { batch_steps: Some(8), ..GpuOptions::default() })?;
    let views = photos(&scene());
    let density = DensityConfig { floor_db, ..DensityConfig::default() };
    let config =
        TrainConfig { policy: Policy::Litetex, save_every: 0, eval_every: 0, density, ..config(150) };
    let meter = gpu.gpu().work_meter();
    // Between the events of a batch the device rests.
    let (mut before, mut after, mut rounds) = (meter(), meter(), Vec::new());
    let mut sink = |event: TrainEvent<'_>| {
        if meter() != after {
            (before, after) = (after, meter());
        }
        if let TrainEvent::Pruned(pruned) = event {
            rounds.push((pruned, between(before, after)));
        }
        Ok(Control::Continue)
    };
    train(&config, &mut gpu, &views, TrainState::fresh(start.clone()), &mut sink).unwrap();
    Some(rounds)
}

#[test]
fn a_round_of_pruning_leaves_the_model_on_the_device() {
    let Some(rounds) = rounds(&damaged(&scene()), DensityConfig::default().floor_db) else { return };
    assert!(rounds.iter().any(|(pruned, _)| pruned.params < pruned.params_before));
    for (pruned, work) in &rounds {
        println!("{pruned:?}\n    {work:?}");
        assert!(work.uploads == 0, "the model was sent again");
        // Those of the five probes.
        assert!(work.photos <= 5, "{} photos", work.photos);
        // Needed 16; an image read for each view, or a wait for each probe, would double them.
        assert!(work.waits <= 20, "{} waits", work.waits);
        // The parameters for density control and again for pruning, 16 bytes of statistics and 88 of costs for each splat.
        let splats = 400 + pruned.splats;
        let most = 8 * pruned.params_before + 104 * splats + STATUS_BYTES;
        assert!(work.read_bytes <= most as u64, "{} bytes", work.read_bytes);
    }
}

#[test]
fn a_training_keeps_two_submissions_in_flight() {
    let (scene, views) = (scene(), photos(&scene()));
    let trained = |batch_steps| {
        let mut gpu = backend(GpuOptions { batch_steps, ..GpuOptions::default() })?;
        let config = TrainConfig { save_every: 0, eval_every: 0, ..config(96) };
        let meter = gpu.gpu().work_meter();
        let start = TrainState::fresh(damaged(&scene));
        let (state, _) = train(&config, &mut gpu, &views, start, &mut |_| Ok(Control::Continue)).unwrap();
        Some((state.model, meter().overlapping))
    };
    let (Some((one, alone)), Some((two, overlapping))) = (trained(Some(1)), trained(None)) else { return };
    // Rounds of pruning overlap in both.
    assert!(overlapping > alone && one == two, "{overlapping}, {alone}");
}

/// The splats in one plane across the first view, where neighbours can merge.
fn wall() -> Model {
    let scene = scene();
    let mut model = damaged(&scene);
    let camera_from_local = scene.camera.camera_from_local;
    let local_from_camera = camera_from_local.inverse();
    let rotation = DQuat::from_mat3(&local_from_camera.rotation);
    let wxyz = [rotation.w, rotation.x, rotation.y, rotation.z].map(|q| q as f32);
    for splat in 0..model.num_splats() {
        let position = &mut model.splats.positions[3 * splat..][..3];
        let in_camera = camera_from_local.transform_point(Vec3::from_slice(position).as_dvec3());
        let in_plane = local_from_camera.transform_point(in_camera / in_camera.z);
        position.copy_from_slice(&in_plane.as_vec3().to_array());
        model.splats.quaternions[4 * splat..][..4].copy_from_slice(&wxyz);
    }
    model
}

#[test]
fn trials_of_merges_send_the_model_twice_at_most() {
    // So low that every model is good enough.
    let Some(rounds) = rounds(&wall(), 10.0) else { return };
    assert!(rounds.iter().any(|(pruned, work)| pruned.merged > 0 && work.uploads > 0));
    for (pruned, work) in &rounds {
        println!("{pruned:?}\n    {work:?}");
        // Needed 1 upload and 19 waits here, where the first trial is good enough; each further one adds 1 and 4.
        assert!(work.uploads <= 2 && work.photos <= 5 && work.waits <= 24, "{work:?}");
        // Parameters of four bytes: for density control, for pruning, for merges, and once with both moments; statistics and costs
        // of 104 bytes a splat.
        let most = 24 * pruned.params_before + 104 * (400 + pruned.splats) + STATUS_BYTES;
        assert!(work.read_bytes <= most as u64, "{} bytes, at most {most}", work.read_bytes);
    }
}
