//! Files are rounded alike whichever backend measures their sensitivities and renders them.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::{drivers, open};
use common::sized::{MAX_BYTES, differing, rounder, run};
use common::training::{config, damaged, photos, scene};
use litetex_exporters::Quality;
use litetex_gs::backend::Backend;
use litetex_gs::bake::{asset_camera, bake};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::gpu::{GpuOptions, LimitChoice};
use litetex_gs::rounding::Rounder as _;
use litetex_gs::selftest::{SceneOptions, random_scene};
use litetex_gs::train::{TrainConfig, TrainState};
use litetex_gs::verify::{Backends, BakedScene, RateGoal, Rounding, find_rounding};
use litetex_gs::{Report, Result};

#[test]
fn files_are_rounded_alike_on_cpu_and_gpu() {
    let options =
        SceneOptions { num_splats: 60, sh_degree: 1, width_px: 64, height_px: 48, ..SceneOptions::default() };
    let scene = random_scene(&options);
    let camera = asset_camera("0.png", false, &scene.camera);
    let asset = bake(&scene.model, vec![camera], [0.2, 0.4, 0.1], Default::default(), &mut Report::default());
    let baked = |seen: usize| {
        let mut asset = asset.clone();
        // What images owe to only some splats: the others are nearly transparent.
        asset.opacities[seen..].iter_mut().for_each(|opacity| *opacity = 0.01);
        BakedScene { asset, path: "scene".into(), contents: None, quantisation: None }
    };
    let rounding = |scene: &BakedScene, backend: &dyn Fn() -> Result<Box<dyn Backend>>| -> Rounding {
        let goal = RateGoal { quality: Quality::Tiny, max_bytes: None, max_loss_db: None, passes: 2 };
        let backends = Backends { statistics: backend, rendering: backend, go_on: &|| true };
        find_rounding(scene, &goal, &backends, &mut Report::default()).unwrap()
    };
    let cpu = || Ok(Box::new(CpuBackend::new(Some(1))?) as Box<dyn Backend>);
    let expected = rounding(&baked(60), &cpu);
    // Exponents are rounded to integers: a splat between two may fall to either side (needed 0).
    let others = |found: &Rounding| {
        let pairs = found.exponents.iter().zip(&expected.exponents);
        pairs.filter(|(a, b)| a != b).count()
    };
    if let Some(choice) = drivers().into_iter().next() {
        let gpu = || {
            let backend = open(&choice, LimitChoice::Downlevel, GpuOptions::default());
            Ok(Box::new(backend) as Box<dyn Backend>)
        };
        let found = rounding(&baked(60), &gpu);
        let (steps, wanted) = (found.steps.unwrap(), expected.steps.unwrap());
        let ratios = [steps.position / wanted.position, steps.sh0 / wanted.sh0, steps.texel / wanted.texel];
        println!("{}: {} exponents differ, steps {ratios:?}", choice.name, others(&found));
        assert!(others(&found) <= 1, "{}: {} exponents differ", choice.name, others(&found));
        // The search goes by notches of 3 %, and may end one apart (needed 3e-7).
        assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.05), "{}: {ratios:?}", choice.name);
    }
    // Negative control: another scene has other exponents.
    assert!(others(&rounding(&baked(30), &cpu)) > 10);
}

#[test]
fn a_run_of_a_wanted_size_ends_rounded_on_a_gpu_too() {
    let scene = scene();
    let views = photos(&scene);
    let Some(choice) = drivers().into_iter().next() else { return };
    let train = |start: TrainState| {
        let config = TrainConfig { max_bytes: Some(MAX_BYTES), eval_every: 0, ..config(150) };
        run(&mut open(&choice, LimitChoice::Downlevel, GpuOptions::default()), &config, &views, start)
    };
    let (state, saved) = train(TrainState::fresh(damaged(&scene)));
    let rounded = state.rounded.as_ref().unwrap();
    assert_eq!((rounded.step, rounded.is_last), (150, true));
    let again = rounder(&views, MAX_BYTES).unwrap().round(&state.model, &rounded.steps, true).unwrap();
    assert_eq!(differing(&state.model, &again), [0; 6], "a rounded model is rounded to itself");
    // Negative control: before the last rounding, the numbers were others.
    let mut exact = state.model.clone();
    rounded.offsets.apply(&mut exact, -1.0);
    let changed = differing(&state.model, &exact);
    assert!(changed.iter().all(|&count| count > 100), "{changed:?}");
    // From within the last phase, the same bytes.
    let start = saved.iter().find(|s| s.rounded.is_some() && s.step < 150).unwrap();
    assert!(train(start.clone()).0.model == state.model);
}
