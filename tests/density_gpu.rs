//! Training with the full method on the wgpu backend: density control and coarse stages in the loop, repeated,
//! and resumed from any checkpoint; from the same statistics, the same decisions as on the CPU backend.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::full_method::{RunRecord, config, is_all_done, large_photos, run_on, same, start};
use common::gpu::backend;
use common::plans::{State, agree, applied, keep};
use litetex_gs::backend::{Backend, WindowStatistics};
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::gpu::GpuOptions;
use litetex_gs::train::charge::Charge;
use litetex_gs::train::density::{
    Budget, Components, MapRule, Revision, Situation, SplatHistory, Timing, revise,
};
use litetex_gs::train::{Policy, TrainState};

fn run(start: TrainState) -> Option<RunRecord> {
    let mut backend = backend(GpuOptions::default())?;
    Some(run_on(&mut backend, &config(Policy::Litetex), &large_photos(), start))
}

#[test]
fn the_full_method_is_reproducible_from_any_checkpoint() {
    let Some(whole) = run(start(Policy::Litetex)) else { return };
    println!("{:?} {:?}", whole.total(), whole.scales);
    assert!(is_all_done(&whole.total()), "{:?}", whole.total());
    assert!(whole.scales[0] > 1.0 && whole.scales.last() == Some(&1.0), "{:?}", whole.scales);
    assert!(same(&run(start(Policy::Litetex)).unwrap().last, &whole.last), "a second run differs");
    // Density control runs every 5 steps: resumes after it, before it, and at it.
    for (at, step) in [(1, 6), (2, 9), (4, 15)] {
        let saved = &whole.saved[at];
        assert_eq!(saved.step, step);
        assert!(same(&run(saved.clone()).unwrap().last, &whole.last), "from step {step}");
    }
    // Negative control: different window statistics.
    let mut other = whole.saved[2].clone();
    other.window.error.reverse();
    assert!(!same(&run(other).unwrap().last, &whole.last));
}

/// The decisions from the model and statistics of a backend.
fn decided(backend: &mut dyn Backend, histories: &[SplatHistory], cameras: &[Camera]) -> Revision {
    let (model, statistics) = (backend.read_flushed().unwrap(), backend.read_statistics().unwrap());
    let config = config(Policy::Litetex);
    let situation = Situation {
        model: &model,
        histories,
        statistics: &statistics,
        cameras,
        settings: &config.density,
        components: Components::default(),
        map_rule: MapRule::Adaptive,
        render_scale: 1.0,
        texture_cap: 64,
        timing: Timing {
            grows: true,
            use_statistics: true,
            texels_trained: true,
            may_coarsen: true,
            may_pad: true,
            sh_tested: 3,
            sh_trial_checks: 0,
            sh_highest: 3,
            max_splits: 40,
            split_texels: Some(12.0),
            patience: 2,
            opacity_floor: 0.02,
        },
        charge: Charge::PARAMS,
        budget: Budget::default(),
        most_charge: f64::INFINITY,
        initial_splats: model.num_splats(),
        seed: 0,
    };
    revise(Policy::Litetex, &situation)
}

#[test]
fn cpu_and_gpu_make_and_apply_the_same_decisions() {
    let views = large_photos();
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let saved = run_on(&mut cpu, &config(Policy::Litetex), &views, start(Policy::Litetex)).saved;
    let before = saved.into_iter().find(|s| s.step == 9).unwrap();
    let cameras: Vec<Camera> = views.0[1..].iter().map(|(camera, _)| *camera).collect();
    // Flushes everything, because updates differ in their last bits between the backends.
    cpu.upload(&before.model, &before.adam).unwrap();
    cpu.apply_plan(&keep(before.model.num_splats())).unwrap();
    let flushed: State = cpu.read_back().unwrap();
    let on = |backend: &mut dyn Backend, window: &WindowStatistics| {
        backend.upload(&flushed.0, &flushed.1).unwrap();
        backend.set_statistics(window).unwrap();
        decided(backend, &before.histories, &cameras)
    };
    let expected = on(&mut cpu, &before.window);
    let plan = expected.plan.as_ref().unwrap();
    let counts = expected.counts;
    println!("{counts:?}");
    assert!(counts.split > 0 && counts.refined > 0 && counts.coarsened > 0, "{counts:?}");
    let mut reversed = before.window.clone();
    reversed.error.reverse();
    let other = on(&mut cpu, &reversed).plan.unwrap();
    assert!(other != *plan, "negative control: different errors give a different plan");
    let made = applied(&mut cpu, &flushed, plan);
    // One driver is enough: the same code decides on all of them, and `twin_gpu` flushes on each.
    let Some(mut gpu) = backend(GpuOptions::default()) else { return };
    let found = on(&mut gpu, &before.window);
    assert!(found.plan == expected.plan && found.histories == expected.histories && found.counts == counts);
    assert!(agree(plan, &applied(&mut gpu, &flushed, plan), &made));
    // Negative control: one map is not changed as planned.
    let mut other = plan.clone();
    let at = plan.maps.iter().position(|m| *m != litetex_gs::backend::MapChange::Keep).unwrap();
    other.maps[at] = litetex_gs::backend::MapChange::Keep;
    assert!(!agree(plan, &applied(&mut gpu, &flushed, &other), &made));
}
