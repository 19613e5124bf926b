//! Training with the full method on the CPU backend: density control in the loop, resumed from any checkpoint,
//! with any number of threads, within budgets.

#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::full_method::{RunRecord, config, is_all_done, run_on, same, start};
use common::training::{MemoryViews, photos, scene};
use litetex_gs::backend::{Backend as _, StepRequest, WindowStatistics};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, LearningRates, Model, ModelSize, TextureMap, TexturePool};
use litetex_gs::train::density::{Budget, DensityConfig, Growth, SplatHistory};
use litetex_gs::train::{DeviceBound, Policy, Schedule, TrainConfig, TrainState};
use litetex_gs::views::{Split, ViewSource as _};

fn run(config: &TrainConfig, start: TrainState, threads: usize) -> RunRecord {
    run_on(&mut CpuBackend::new(Some(threads)).unwrap(), config, &photos(&scene()), start)
}

#[test]
fn every_policy_gives_the_same_bytes_with_any_number_of_threads_and_from_any_checkpoint() {
    for policy in [Policy::Litetex, Policy::Cat, Policy::Fixed(3), Policy::Plain, Policy::Paper] {
        let mut config = config(policy);
        if policy == Policy::Plain {
            config.budget = Budget { max_splats: Some(400), ..Budget::default() };
        }
        let whole = run(&config, start(policy), 2);
        let total = whole.total();
        println!("{policy}: {total:?}");
        assert!(total.split + total.respawned > 3, "{policy}: {total:?}");
        assert!(policy != Policy::Litetex || is_all_done(&total), "{total:?}");
        assert!(same(&run(&config, start(policy), 1).last, &whole.last), "{policy}: one thread");
        // Before, at and after density-control steps, and within statistics windows.
        for at in [0, 3, 4, 5, 9] {
            let resumed = run(&config, whole.saved[at].clone(), 2);
            assert!(same(&resumed.last, &whole.last), "{policy}: from step {}", whole.saved[at].step);
        }
        // Negative controls: different splat histories, and a different window, end differently.
        if policy == Policy::Litetex {
            let mut other = whole.saved[3].clone();
            other.histories.iter_mut().for_each(|history| history.ceiling = 2);
            assert!(!same(&run(&config, other, 2).last, &whole.last));
            let mut other = whole.saved[3].clone();
            other.window.error.reverse();
            assert!(!same(&run(&config, other, 2).last, &whole.last), "the window does not matter");
        }
    }
}

#[test]
fn a_budget_of_parameters_gives_the_same_bytes_too() {
    let policy = Policy::Litetex;
    let mut first = start(policy);
    first.model.splats.set_sh_degrees(&vec![1; first.model.num_splats()]);
    first.adam = AdamState::zeros(&first.model);
    let most = first.model.num_params() * 3 / 2;
    let mut config = config(policy);
    config.sh_degree = 2;
    (config.density.sh_below, config.density.sh_raise) = (1e-4, 2e-4);
    config.budget = Budget { max_params: Some(most), ..Budget::default() };
    let whole = run(&config, first.clone(), 2);
    let total = whole.total();
    println!("{total:?}");
    assert!(total.split > 10 && total.refined > 10 && total.bands_gained > 10, "{total:?}");
    assert!(whole.last.model.num_params() <= most);
    assert!(same(&run(&config, first.clone(), 1).last, &whole.last), "one thread");
    for at in [0, 3, 4, 5, 9] {
        let resumed = run(&config, whole.saved[at].clone(), 2);
        assert!(same(&resumed.last, &whole.last), "from step {}", whole.saved[at].step);
    }
    // Negative control: splats that gain no more bands.
    let mut other = whole.saved[1].clone();
    other.histories.iter_mut().for_each(|history| history.bands_settled = true);
    assert!(!same(&run(&config, other, 2).last, &whole.last));
    // Growth by need keeps what it has seen.
    let by_need = DensityConfig { need_db: 0.05, ..config.density.clone() };
    let by_need = TrainConfig { density: by_need, ..config };
    let whole = run(&by_need, first, 2);
    assert!(whole.last.growth != Growth::default());
    for at in [3, 9] {
        assert!(same(&run(&by_need, whole.saved[at].clone(), 2).last, &whole.last));
    }
}

#[test]
fn published_rules_spend_budgets_evenly_from_any_initial_size() {
    let policy = Policy::Paper;
    let first = start(policy);
    let size = first.model.num_params();
    // Parameters and splits after the first density-control step, at a quarter of the time to the end of
    // densification.
    let after_the_first = |budget: usize| {
        let mut config = config(policy);
        config.density.opacity_floor = Some([0.0; 2]);
        config.density.split_texels = [3.0; 2];
        config.density.overshoot = 1.0;
        config.budget = Budget { max_params: Some(budget), ..Budget::default() };
        let (counts, splats, texels) = run(&config, first.clone(), 2).steps[0];
        (ModelSize { texels, ..ModelSize::uniform(splats, 1, config.sh_degree) }.params(), counts.split)
    };
    let (free, _) = after_the_first(1_000 * size);
    let growth = free - size;
    // Room for twice that growth, of which a quarter may be used: half of the growth.
    let (params, split) = after_the_first(size + 2 * growth);
    assert!(
        split > 0 && params > size && params <= size + growth / 2,
        "{split} splits: {params} of {size}, {free} without a bound"
    );
    // Negative control: a budget that is used up.
    assert_eq!(after_the_first(size), (size, 0));
}

/// Settings with which maps always fit and no splat is removed, so that density control can only add: of the published rule, which
/// drops no map.
fn adding_only() -> TrainConfig {
    let mut config = config(Policy::Paper);
    (config.rates.log_scale, config.rates.opacity) = (0.0, 0.0);
    (config.components.pruning, config.components.coarsening) = (false, false);
    config.density = DensityConfig {
        sh_below: 0.0,
        opacity_floor: Some([0.0; 2]),
        prune_contribution: 0.0,
        prune_area: 0.0,
        split_texels: [1e9; 2],
        prune_db: 0.0,
        ..config.density
    };
    config
}

#[test]
fn density_control_without_growth_changes_only_histories_and_the_window() {
    let with = |interval: Option<u32>, min_texel_px: f64| {
        let mut config = adding_only();
        (config.density.interval, config.density.min_texel_px) = (interval, min_texel_px);
        run(&config, start(Policy::Paper), 2)
    };
    // In both, texels are already finer than allowed; in the second, the interval is longer than the run.
    let (idle, none) = (with(None, 1e3), with(Some(3_000_000), 1e3));
    assert_eq!((idle.steps.len(), none.steps.len()), (7, 0));
    let rest = |state: &TrainState| TrainState {
        histories: Vec::new(),
        window: WindowStatistics::default(),
        window_views: Vec::new(),
        // Pairs are counted anew after each density-control step.
        device: DeviceBound { pairs: 0, visible: 0, ..state.device },
        stage_step: 0,
        revised_step: 0,
        ..state.clone()
    };
    for (idle, none) in idle.saved.iter().zip(&none.saved) {
        assert!(same(&rest(idle), &rest(none)), "step {}", idle.step);
        // Density control runs every 5 steps, and each view is used once in 5.
        let views = if idle.step < 39 { idle.step % 5 } else { idle.step - 35 };
        assert_eq!((idle.window.views, idle.window_views.len()), (views, views as usize), "{}", idle.step);
        if views == 0 {
            assert_eq!(idle.window, WindowStatistics::empty(idle.model.num_splats()));
        }
        assert_eq!(none.window.views, idle.step.min(5));
    }
    // Checks are counted, and the ceilings of high-error splats rise.
    let (before, after) = (&none.last.histories, &idle.last.histories);
    let but_ceilings = |(a, b): (&SplatHistory, &SplatHistory)| {
        *b == SplatHistory { ceiling: b.ceiling, checks: a.checks + 7, ..*a }
    };
    assert!(before.len() == after.len() && before.iter().zip(after).all(but_ceilings));
    assert!(
        after.iter().any(|history| history.ceiling > 2) && before.iter().all(|history| history.ceiling == 2)
    );
    // Negative control: allows finer texels.
    let busy = with(None, 0.25);
    assert!(busy.total().refined > 0 && !same(&rest(&busy.last), &rest(&none.last)));
    assert_eq!(idle.total(), Default::default());
}

/// Pairs of consecutive states between which some map changed its size.
fn resized(saved: &[TrainState]) -> Vec<[&TrainState; 2]> {
    let sizes = |state: &TrainState| {
        let maps = state.model.textures.maps.iter();
        maps.map(|m| (m.rows, m.cols, m.texel_sizes.map(f32::to_bits))).collect::<Vec<_>>()
    };
    saved.windows(2).map(|w| [&w[0], &w[1]]).filter(|[a, b]| sizes(a) != sizes(b)).collect()
}

#[test]
fn cropping_between_density_control_steps_is_the_same_from_any_checkpoint() {
    // Density control after 100 of 125 steps; maps are cropped and padded every 40.
    let mut config = config(Policy::Authors);
    (config.steps, config.save_every) = (125, 1);
    config.density = DensityConfig { interval: Some(24_000), densify_until: Some(30_000), ..config.density };
    let schedule = Schedule::new(&config, 5);
    let crops: Vec<u32> = (1..=125).filter(|&step| schedule.is_crop_step(step)).collect();
    assert_eq!((crops, schedule.density_interval), (vec![40, 80, 120], 100));
    let mut model = start(Policy::Litetex).model;
    let maps = model.textures.maps.iter().map(|m| TextureMap::square(8, 8, m.texel_sizes[0] / 7.0));
    model.textures = TexturePool::neutral(maps.collect::<Vec<_>>()).unwrap();
    let first = TrainState::fresh(model);

    let whole = run(&config, first.clone(), 2);
    let changes = resized(&whole.saved);
    assert_eq!(changes.iter().map(|[_, after]| after.step).collect::<Vec<_>>(), [40, 80, 100, 120]);
    let [mut cropped, mut padded] = [0, 0];
    for [before, after] in changes {
        if after.step == 100 {
            assert_eq!(after.window.views, 0, "a density-control step begins a window");
            continue;
        }
        for (a, b) in before.model.textures.maps.iter().zip(&after.model.textures.maps) {
            cropped += usize::from(b.rows < a.rows || b.cols < a.cols);
            padded += usize::from(b.rows > a.rows || b.cols > a.cols);
            assert_eq!(b.texel_sizes, a.texel_sizes, "resampled after step {}", after.step);
        }
        // The window continues: all of its five views had been used.
        assert!(before.window.views == 5 && before.window == after.window);
        assert!(before.histories == after.histories && before.window_views == after.window_views);
    }
    println!("{cropped} cropped, {padded} padded");
    assert!(cropped > 0 && padded > 0);
    assert!(same(&run(&config, first.clone(), 1).last, &whole.last), "one thread");
    // Resumes before and at each of them: a crop is not repeated.
    for step in [39, 40, 79, 80, 119, 120] {
        let saved = whole.saved[step - 1].clone();
        assert_eq!(saved.step as usize, step);
        assert!(same(&run(&config, saved, 2).last, &whole.last), "from step {step}");
    }
    // Negative control: with an interval one step shorter, there is no cropping in between.
    config.density.interval = Some(23_760);
    let closer = run(&config, first, 2);
    assert_eq!(resized(&closer.saved).iter().map(|[_, after]| after.step).collect::<Vec<_>>(), [99]);
    assert!(!same(&closer.last, &whole.last));
}

#[test]
fn no_budget_is_ever_exceeded() {
    // No splat fades, and most are long enough to be split.
    let mut growing = config(Policy::Litetex);
    growing.density.opacity_floor = Some([0.0; 2]);
    growing.density.split_texels = [3.0; 2];
    growing.density.overshoot = 1.0;
    let free = run(&growing, start(Policy::Litetex), 2).largest;
    let initial = start(Policy::Litetex).model;
    assert!(free[0] > initial.num_splats() + 20 && free[1] > initial.num_texels() + 100, "{free:?}");
    let budgets = [
        Budget { max_splats: Some(initial.num_splats() + 7), ..Budget::default() },
        Budget { max_texels: Some(initial.num_texels() + 60), ..Budget::default() },
        Budget { max_params: Some(initial.num_params() + 500), ..Budget::default() },
    ];
    for budget in budgets {
        let config = TrainConfig { budget, ..growing.clone() };
        // Each is its own maximum over the run.
        let record = run(&config, start(Policy::Litetex), 2);
        let [splats, texels, params] = record.largest;
        let held = record.saved.iter().chain([&record.last]).map(|state| state.model.num_params()).max();
        assert!(budget.max_splats.is_none_or(|most| splats <= most), "{budget:?}: {splats} splats");
        assert!(budget.max_texels.is_none_or(|most| texels <= most), "{budget:?}: {texels} texels");
        assert!(budget.max_params.is_none_or(|most| params <= most), "{budget:?}: {params} parameters");
        assert!(
            budget.max_params.is_none_or(|most| held.is_some_and(|held| held <= most)),
            "{budget:?}: {held:?}"
        );
    }
}

#[test]
fn what_grew_beyond_the_budget_is_pruned() {
    let mut config = config(Policy::Litetex);
    config.density.opacity_floor = Some([0.0; 2]);
    config.density.split_texels = [3.0; 2];
    config.density.overshoot = 2.0;
    config.density.sh_below = 0.0;
    let first = start(Policy::Litetex);
    let most = first.model.num_params() + 50;
    config.budget.max_params = Some(most);
    let record = run(&config, first, 2);
    assert!(record.largest[2] > most, "{:?}", record.largest);
    let (last, pruned) = (record.last.model.num_params(), &record.last.history.pruned);
    assert!(last <= most, "{last} of {most}, {pruned:?}");
    assert!(!pruned.is_empty());
    assert!(pruned.iter().all(|round| round.params < round.params_before), "{pruned:?}");
}

#[test]
fn the_untextured_policy_keeps_its_budget_of_parameters_whatever_the_degrees() {
    let mut first = start(Policy::Plain);
    // Splats of the highest degree have the largest error: they are split in place of cheap ones.
    let degrees: Vec<u8> = (0..first.model.num_splats()).map(|i| u8::from(i % 3 == 0)).collect();
    first.model.splats.set_sh_degrees(&degrees);
    first = TrainState::fresh(first.model);
    let most = first.model.num_params() + 900;
    let mut config = config(Policy::Plain);
    config.density.prune_db = 0.0;
    config.density.densify_until = Some(25_000);
    config.budget = Budget { max_params: Some(most), ..Budget::default() };
    let record = run(&config, first.clone(), 2);
    let held = record.saved.iter().chain([&record.last]).map(|state| state.model.num_params()).max().unwrap();
    assert!(held <= most && held > first.model.num_params() + 300, "{held} of {most}");
}

#[test]
fn window_statistics_agree_for_any_order_of_the_views() {
    let views = photos(&scene());
    let model = start(Policy::Litetex).model;
    let order = views.indices(Split::Train);
    let reversed: Vec<usize> = order.iter().rev().copied().collect();
    let (forward, backward) = (sums(&views, &model, &order), sums(&views, &model, &reversed));
    assert_eq!(forward.seen, backward.seen);
    // Needed 2e-7 of the largest, because of the order of five f32 summands.
    let close = |a: &[f32], b: &[f32]| {
        let largest = a.iter().copied().fold(0.0, f32::max);
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-6 * largest)
    };
    assert!(close(&forward.error, &backward.error) && close(&forward.area, &backward.area));
    // Negative control: one view less.
    assert!(!close(&forward.error, &sums(&views, &model, &order[1..]).error));
}

fn sums(views: &MemoryViews, model: &Model, order: &[usize]) -> WindowStatistics {
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    backend.upload(model, &AdamState::zeros(model)).unwrap();
    for &view in order {
        let (camera, target) = &views.0[view];
        backend
            .step(&StepRequest {
                step: 1,
                camera: *camera,
                photo: Some(view as u32),
                target,
                background: [0.0; 3],
                sh_degree: 1,
                loss: Default::default(),
                rates: LearningRates::default(),
                accumulate_statistics: true,
                exposure: None,
            })
            .unwrap();
    }
    backend.read_statistics().unwrap()
}

#[test]
fn parameters_count_as_in_the_papers_ablation() {
    // Points, texels and parameters of rows I to V, as printed in thousands and millions.
    for (splats, texels, params) in [
        (255_000, 40_000_000, 135_000_000),
        (162_000, 14_100_000, 52_000_000),
        (119_000, 16_200_000, 55_800_000),
        (173_000, 10_500_000, 41_700_000),
        (209_000, 16_300_000, 61_200_000_usize),
    ] {
        let counted = ModelSize { splats, texels, ..ModelSize::default() }.params_published();
        // The printed numbers are rounded: texels to 0.05 M.
        assert!(counted.abs_diff(params) < 3 * 50_000 + 59 * 500 + 50_000, "{counted} {params}");
    }
    let mut model = scene().model;
    let textured = model.textures.maps.iter().filter(|map| map.num_texels() > 0).count();
    assert!(textured > 0, "nothing was tested");
    let (splats, texels) = (model.num_splats(), model.num_texels());
    model.splats.set_sh_degrees(&vec![1; splats]);
    assert_eq!(model.splats.sh_degree(), 1);
    assert_eq!(model.num_params(), (10 + 12) * splats + 2 * textured + 3 * texels);
    // What the model stores: an empty map has no texel size.
    model.textures = TexturePool::neutral(vec![TextureMap::default(); splats]).unwrap();
    assert_eq!(model.num_params(), 22 * splats);
    // A splat of degree 0.
    let degrees: Vec<u8> = (0..splats).map(|i| u8::from(i > 0)).collect();
    model.splats.set_sh_degrees(&degrees);
    assert_eq!(model.num_params(), 22 * splats - 9);
}
