//! The counters of the wgpu backend: pairs, atomics, dispatches. Counting does not change results.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::backend;
use litetex_gs::backend::{Backend, LearningRates, LossWeights, StepReport, StepRequest};
use litetex_gs::gpu::{GpuBackend, GpuOptions};
use litetex_gs::model::{AdamState, Filter, Model};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};

fn scene(map_sizes: Vec<(u16, u16)>) -> RandomScene {
    random_scene(&SceneOptions {
        num_splats: 200,
        width_px: 64,
        height_px: 48,
        scales: (0.05, 0.4),
        opacities: (0.05, 0.8),
        map_sizes,
        filter: Filter::None,
        ..SceneOptions::default()
    })
}

fn run(
    backend: &mut GpuBackend,
    scene: &RandomScene,
    options: GpuOptions,
    steps: u32,
) -> (Model, AdamState, Vec<StepReport>) {
    backend.set_options(options).unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let request = |step| StepRequest {
        step,
        camera: scene.camera,
        photo: Some(0),
        target: &scene.target,
        background: [0.1, 0.2, 0.3],
        sh_degree: 3,
        // Without the texture term, only texels with an atomic move.
        loss: LossWeights { texture: 0.0, ..LossWeights::PUBLISHED },
        rates: LearningRates { position: 2e-4, texel: 2e-3, sh_dc: 2.5e-3, ..LearningRates::default() },
        accumulate_statistics: false,
        exposure: None,
    };
    let reports = backend.steps(&(1..=steps).map(request).collect::<Vec<_>>()).unwrap();
    let (model, adam) = backend.read_back().unwrap();
    (model, adam, reports)
}

#[test]
fn atomics_are_counted_and_counting_changes_no_bit() {
    let Some(mut backend) = backend(GpuOptions::default()) else { return };
    let plain = GpuOptions { hardware_kernels: Some(false), ..GpuOptions::default() };
    let counting = GpuOptions { count_texel_atomics: true, count_pairs: true, ..plain };
    let hardware = GpuOptions { hardware_kernels: Some(true), ..counting };
    // Large maps: most windows have more blocks than the hardware variant gathers.
    let scene = scene(vec![(40, 40), (4, 4)]);
    let (model, adam, reports) = run(&mut backend, &scene, plain, 2);
    let (counted_model, counted_adam, counted) = run(&mut backend, &scene, counting, 2);
    assert!(model == counted_model && adam == counted_adam);
    let atomics = counted[0].counters.texel_atomics;
    let c = counted[0].counters;
    println!("{atomics} atomics, {c:?}");
    assert_eq!((reports[0].non_finite_gradients, reports[0].counters.texel_atomics), (0, 0));
    assert_eq!(counted[0].non_finite_gradients, 0, "atomics do not count as faults");
    assert_eq!((reports[0].counters.blended_pairs, reports[0].counters.tile_pairs), (0, c.tile_pairs));
    // Without a filter: at most four taps of three channels per pair, and at least one atomic per float that moved.
    let in_all: u64 = counted.iter().map(|r| r.counters.texel_atomics).sum();
    let moved = adam.texels_m.iter().filter(|m| **m != 0.0).count() as u64;
    assert!(atomics <= 12 * c.blended_pairs && moved > 1000 && in_all >= moved, "{in_all} for {moved}");
    // The hardware variant adds tap by tap.
    let (scattered, _, by_tap) = run(&mut backend, &scene, hardware, 2);
    let taps = by_tap[0].counters.texel_atomics;
    println!("{taps} tap by tap");
    assert!(taps > atomics && taps <= 12 * c.blended_pairs);
    let worst = scattered.textures.texels.iter().zip(&model.textures.texels).map(|(a, b)| (a - b).abs());
    assert!(worst.fold(0.0, f32::max) < 0.02, "both variants compute the same");
    // Negative control: no texels, no atomics.
    let untextured = self::scene(vec![(0, 0)]);
    assert_eq!(run(&mut backend, &untextured, counting, 1).2[0].counters.texel_atomics, 0);
}

#[test]
fn waits_and_submissions_follow_the_batches() {
    let Some(mut backend) = backend(GpuOptions::default()) else { return };
    let scene = scene(vec![(4, 4)]);
    let mut work = Vec::new();
    for batch_steps in [16, 4, 1] {
        let options = GpuOptions { batch_steps: Some(batch_steps), ..GpuOptions::default() };
        // Grows the buffers to their final size.
        run(&mut backend, &scene, options, 1);
        let [one, more] = [1, 17].map(|steps| {
            let before = backend.gpu().work();
            run(&mut backend, &scene, options, steps);
            let after = backend.gpu().work();
            [
                after.dispatches - before.dispatches,
                after.submissions - before.submissions,
                after.waits - before.waits,
            ]
        });
        // The difference is 16 steps, which may share a batch with the first.
        work.push([0, 1, 2].map(|k| more[k] - one[k]));
    }
    // 2, 5 and 17 batches instead of one, each with a submission and a wait.
    assert_eq!(work[0][1..], [1, 1]);
    assert_eq!(work[1][1..], [4, 4]);
    assert_eq!(work[2][1..], [16, 16]);
    // Each batch ends with one dispatch for the splats that its last step did not see.
    let of_steps: Vec<u64> = work.iter().map(|[dispatches, batches, _]| dispatches - batches).collect();
    assert!(of_steps[0] <= 16 * 32 && of_steps.iter().all(|&d| d == of_steps[0]), "dispatches: {work:?}");
}
