//! Scenes that a device cannot hold are refused before the first step, and growth stops at its limits.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::{drivers, open};
use common::training::{MemoryViews, config, damaged, photos, scene_options};
use litetex_gs::Error;
use litetex_gs::backend::{Backend as _, SceneShape};
use litetex_gs::gpu::{GpuOptions, LimitChoice};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};
use litetex_gs::train::density::Budget;
use litetex_gs::train::{
    Control, GROWTH_ENDED, Policy, SMALLER_IMAGES, TrainConfig, TrainEvent, TrainState, train,
};

/// Buffers of 120,000 bytes: 1,363 splats of 22 floats, 7,500 texels of 16 bytes, 3,333 pixels of 36 bytes.
const SMALL: LimitChoice = LimitChoice::Buffers(120_000);

/// Half as many splats as in the common scene, about half as wide, so that there is room to grow.
fn scene() -> RandomScene {
    random_scene(&SceneOptions { num_splats: 150, scales: (0.03, 0.1), ..scene_options() })
}

/// Settings for the fastest growth.
fn growing() -> TrainConfig {
    let mut config = TrainConfig { policy: Policy::Litetex, save_every: 0, eval_every: 0, ..config(60) };
    config.components.growth = false;
    config.density.quantile = 0.1;
    config.density.min_texel_px = 0.2;
    config
}

/// Runs a training. Returns the largest number of splats and texels after any density-control step, or the
/// error; and the number of events.
fn run(
    config: &TrainConfig,
    limits: LimitChoice,
    scene: &RandomScene,
    views: &MemoryViews,
) -> Option<(Result<[usize; 2], Error>, usize)> {
    let driver = drivers().into_iter().next()?;
    let mut backend = open(&driver, limits, GpuOptions::default());
    let (mut largest, mut events) = ([0; 2], 0);
    let mut sink = |event: TrainEvent<'_>| {
        events += 1;
        if let TrainEvent::DensityControl { size, .. } = event {
            largest = [largest[0].max(size.splats), largest[1].max(size.texels)];
        }
        // Stops once the model has outgrown the small device.
        Ok(if largest[1] > 7_500 { Control::Stop } else { Control::Continue })
    };
    let outcome = train(config, &mut backend, views, TrainState::fresh(damaged(scene)), &mut sink);
    Some((outcome.map(|_| largest), events))
}

#[test]
fn scenes_that_do_not_fit_are_refused_before_the_first_step() {
    let (scene, config) = (scene(), growing());
    let views = photos(&scene);
    let is_refused = |config: &TrainConfig, views: &MemoryViews, scene: &RandomScene, parts: &[&str]| {
        let Some((outcome, events)) = run(config, SMALL, scene, views) else { return };
        let error = outcome.unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, Error::Device(_)) && error.exit_code() == 5, "{text}");
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        assert_eq!(events, 0, "training had started");
    };
    let many = random_scene(&SceneOptions {
        num_splats: 1_251,
        sh_degree: 1,
        map_sizes: vec![(4, 2)],
        ..SceneOptions::default()
    });
    is_refused(&config, &views, &many, &["1251 splats, at most 1250", "10008 texels, at most 7500"]);
    let bounded = |budget| TrainConfig { budget, ..config.clone() };
    let splats = bounded(Budget { max_splats: Some(1_251), ..Budget::default() });
    is_refused(&splats, &views, &scene, &["budget.max-splats allows 1251 splats, at most 1250"]);
    let texels = bounded(Budget { max_texels: Some(7_501), ..Budget::default() });
    is_refused(&texels, &views, &scene, &["budget.max-texels allows 7501 texels, at most 7500"]);
    let mut large = photos(&scene);
    large.0[3].0 = large.0[3].0.resized(70, 50);
    is_refused(
        &config,
        &large,
        &scene,
        &["1 of 6 views", "70 x 50 = 3500 pixels, at most 3333", "--max-resolution 68"],
    );
    // Terms on depths and normals need 48 bytes per pixel, of which 2,500 fit.
    let mut geometry = config.clone();
    geometry.loss.normal = 0.1;
    is_refused(&geometry, &views, &scene, &["6 of 6 views", "at most 2500 pixels"]);
}

#[test]
fn growth_stops_at_the_limits_of_the_device() {
    let (scene, config) = (scene(), growing());
    let views = photos(&scene);
    let Some((small, _)) = run(&config, SMALL, &scene, &views) else { return };
    let [_, texels] = small.unwrap();
    let Some((plenty, _)) = run(&config, LimitChoice::Downlevel, &scene, &views) else { return };
    let [_, wanted] = plenty.unwrap();
    println!("{texels} texels on a device that holds 7,500, {wanted} on another");
    assert!(texels <= 7_500 && texels > 6_000, "{texels}");
    // Negative control: on a larger device the model outgrows this limit.
    assert!(wanted > 7_500, "{wanted}");
    // A budget below the limits of the device applies.
    let budget = Budget { max_texels: Some(5_000), ..Budget::default() };
    let Some((bounded, _)) = run(&TrainConfig { budget, ..config }, SMALL, &scene, &views) else { return };
    assert!(bounded.unwrap()[1] <= 5_000);
}

/// The last state, pairs of each step, most splats and codes of the warnings of a run.
fn run_with(options: GpuOptions) -> Option<(TrainState, Vec<u64>, usize, Vec<String>)> {
    let driver = drivers().into_iter().next()?;
    let mut backend = open(&driver, LimitChoice::Downlevel, options);
    let scene = scene();
    let (mut pairs, mut splats, mut codes) = (Vec::new(), 0, Vec::new());
    let mut sink = |event: TrainEvent<'_>| {
        match event {
            TrainEvent::Step { report, .. } => pairs.push(report.counters.tile_pairs),
            TrainEvent::DensityControl { size, .. } => splats = splats.max(size.splats),
            TrainEvent::Warning(warning) => codes.push(warning.code),
            _ => {}
        }
        Ok(Control::Continue)
    };
    let config = TrainConfig { steps: 30, ..growing() };
    let start = TrainState::fresh(damaged(&scene));
    let (state, _) = train(&config, &mut backend, &photos(&scene), start, &mut sink).unwrap();
    Some((state, pairs, splats, codes))
}

#[test]
fn a_run_with_more_pairs_than_fit_goes_on() {
    let Some((_, plenty, wanted, codes)) = run_with(GpuOptions::default()) else { return };
    let (first, last) = (*plenty[..5].iter().max().unwrap(), *plenty.iter().max().unwrap());
    println!("{first} pairs at first, {last} at last, {wanted} splats");
    assert!(codes.is_empty() && last > first * 5 / 4, "growth needs too few pairs: nothing is tested");
    for (most, expected) in [(u64::midpoint(first, last), GROWTH_ENDED), (first * 3 / 4, SMALLER_IMAGES)] {
        let options = GpuOptions { most_pairs: Some(most), ..GpuOptions::default() };
        let (state, pairs, splats, codes) = run_with(options).unwrap();
        assert_eq!((pairs.len(), codes), (30, vec![expected.to_owned()]));
        assert!(pairs.iter().all(|&pairs| pairs <= most) && splats < wanted, "{splats} splats, {pairs:?}");
        assert_eq!(state.device.least_scale > 1.0, expected == SMALLER_IMAGES);
        // The same in batches of any size, and with buffers that have to grow.
        for (batch_steps, pair_capacity) in [(1, None), (16, Some(50))] {
            let options = GpuOptions { batch_steps: Some(batch_steps), pair_capacity, ..options };
            let (other, ..) = run_with(options).unwrap();
            assert!(other.model == state.model && other.device == state.device, "batches of {batch_steps}");
        }
    }
}

#[test]
fn the_reported_limits_are_those_of_uploads() {
    let Some(driver) = drivers().into_iter().next() else { return };
    let mut backend = open(&driver, SMALL, GpuOptions::default());
    let limits = backend.limits(SceneShape { sh_degree: 1, geometry: false });
    assert_eq!((limits.max_splats, limits.max_texels, limits.max_pixels), (1_250, 7_500, 3_333));
    let upload = |n: u64, map, backend: &mut litetex_gs::gpu::GpuBackend| {
        let options = SceneOptions {
            num_splats: n as usize,
            sh_degree: 1,
            map_sizes: vec![map],
            ..SceneOptions::default()
        };
        let model = random_scene(&options).model;
        backend.upload(&model, &litetex_gs::model::AdamState::zeros(&model))
    };
    assert!(upload(limits.max_splats, (1, 1), &mut backend).is_ok());
    assert!(matches!(upload(limits.max_splats + 1, (1, 1), &mut backend), Err(Error::DeviceFull(_))));
    // 75 maps of 100 texels.
    assert!(upload(75, (10, 10), &mut backend).is_ok());
    assert!(matches!(upload(76, (10, 10), &mut backend), Err(Error::DeviceFull(_))));
}
