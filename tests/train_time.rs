//! Runs with a time, by a clock that the test advances: the CPU backend computes, and each of its steps takes as long as the
//! test says.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::training::{MemoryViews, damaged, photos, scene_options};
use litetex_gs::Result;
use litetex_gs::backend::{
    Backend, Costs, DensityPlan, DeviceInfo, DeviceLimits, Probe, RenderOptions, RenderedImage, SavedState,
    SceneShape, StepReport, StepRequest, WindowStatistics,
};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};
use litetex_gs::train::{
    Control, LengthChange, MOST_STEPS, Schedule, StepCosts, StopReason, Timing, TrainConfig, TrainEvent,
    TrainState, train, train_by,
};
use litetex_gs::views::{Split, ViewSource as _};
use std::cell::Cell;

/// A device on which steps and renders take a stated time.
struct Timed<'a> {
    inner: CpuBackend,
    secs: &'a Cell<f64>,
    /// Seconds of a step that is the `n`-th of all, probes and trials included.
    step_secs: &'a dyn Fn(u32) -> f64,
    done: u32,
}

impl Backend for Timed<'_> {
    fn device(&self) -> DeviceInfo {
        self.inner.device()
    }
    fn limits(&self, shape: SceneShape) -> DeviceLimits {
        self.inner.limits(shape)
    }
    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        self.inner.upload(model, adam)
    }
    fn save(&mut self) -> Result<SavedState> {
        self.inner.save()
    }
    fn restore(&mut self, saved: &SavedState) -> Result<()> {
        self.inner.restore(saved)
    }
    fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>> {
        let Self { inner, secs, step_secs, done } = self;
        inner.probe(&mut probes.inspect(|_| {
            *done += 1;
            secs.set(secs.get() + step_secs(*done));
        }))
    }
    fn render(
        &mut self,
        camera: &litetex_gs::camera::Camera,
        options: &RenderOptions,
    ) -> Result<RenderedImage> {
        self.secs.set(self.secs.get() + 0.3 * (self.step_secs)(self.done));
        self.inner.render(camera, options)
    }
    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
        self.done += 1;
        self.secs.set(self.secs.get() + (self.step_secs)(self.done));
        self.inner.step(request)
    }
    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        self.inner.read_statistics()
    }
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        self.inner.set_statistics(statistics)
    }
    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        self.inner.apply_plan(plan)
    }
    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        self.inner.read_back()
    }
    fn read_flushed(&mut self) -> Result<Model> {
        self.inner.read_flushed()
    }
}

const STEPS: u32 = 200;
/// Seconds planned for, of which the run is told when it ends: 200 steps of 1 s, two rounds of pruning, and the end.
const DEADLINE_SECS: f64 = 260.0;

/// Small: the clock is the test's, the computing only has to be real.
fn scene() -> RandomScene {
    random_scene(&SceneOptions { num_splats: 80, width_px: 32, height_px: 24, ..scene_options() })
}

fn settings() -> TrainConfig {
    TrainConfig { steps: STEPS, sh_degree: 1, ..TrainConfig::default() }
}

/// What a run came to.
struct Found {
    state: TrainState,
    plan: Vec<LengthChange>,
    secs: f64,
    /// Share of the time gone, and the time left as it was told over what it came to be.
    etas: Vec<(f64, f64)>,
    /// When each step was told of.
    step_secs: Vec<f64>,
    stopped: Option<(TrainState, Vec<LengthChange>, f64)>,
    /// Times of the interim checkpoints.
    interim_secs: Vec<f64>,
}

/// A run by the clock, from `start`, `gone` seconds after its beginning; it is stopped after step `stop`.
fn run(
    config: &TrainConfig,
    start: (TrainState, f64),
    step_secs: &dyn Fn(u32) -> f64,
    stop: Option<u32>,
) -> Found {
    run_within((DEADLINE_SECS, MOST_STEPS), config, start, step_secs, stop)
}

/// [`run`] with another deadline, and a bound of the steps.
fn run_within(
    (deadline_secs, most_steps): (f64, u32),
    config: &TrainConfig,
    (start, gone): (TrainState, f64),
    step_secs: &dyn Fn(u32) -> f64,
    stop: Option<u32>,
) -> Found {
    let scene = scene();
    let views: MemoryViews = photos(&scene);
    let secs = Cell::new(gone);
    let now = || secs.get();
    let costs = StepCosts { fixed_secs: 1.0, secs_per_pixel: 1e-9, secs_per_splat: 1e-9, ..StepCosts::CPU };
    let timing = Timing { now: &now, deadline_secs: Some(deadline_secs), most_steps, costs, end_secs: 1.0 };
    let mut backend =
        Timed { inner: CpuBackend::new(Some(2)).unwrap(), secs: &secs, step_secs, done: start.step };
    let (mut plan, mut told, mut saved) = (config.plan.clone(), Vec::new(), None);
    let mut interim_secs = Vec::new();
    let mut sink = |event: TrainEvent<'_>| {
        match event {
            TrainEvent::Planned { step, last_step, .. } => plan.push([step, last_step]),
            TrainEvent::Step { step, remaining_secs, .. } => {
                told.push((secs.get(), remaining_secs));
                if Some(step) == stop {
                    return Ok(Control::Stop);
                }
            }
            TrainEvent::Checkpoint { is_interim: true, .. } => interim_secs.push(secs.get()),
            TrainEvent::Checkpoint { state, .. } => saved = Some((state.clone(), secs.get())),
            _ => {}
        }
        Ok(Control::Continue)
    };
    let (state, reason) = train_by(&timing, config, &mut backend, None, &views, start, &mut sink).unwrap();
    assert_eq!(reason == StopReason::Consumer, stop.is_some());
    let end = secs.get();
    let step_secs = told.iter().map(|(then, _)| *then).collect();
    let etas = told.into_iter().map(|(then, left)| (then / end, left / (end - then).max(1e-9))).collect();
    let stopped = saved.filter(|_| stop.is_some()).map(|(state, then)| (state, plan.clone(), then));
    Found { state, plan, secs: end, etas, step_secs, stopped, interim_secs }
}

fn fresh() -> (TrainState, f64) {
    (TrainState::fresh(damaged(&scene())), 0.0)
}

#[test]
fn a_run_ends_at_its_deadline_whatever_its_steps_cost() {
    let courses: [(&str, &dyn Fn(u32) -> f64); 4] = [
        ("as expected", &|_| 1.0),
        ("growing", &|n| 0.6 + f64::from(n) / 200.0),
        ("half as fast from the middle", &|n| if n < 100 { 0.9 } else { 1.8 }),
        ("faster than measured", &|_| 0.7),
    ];
    for (name, step_secs) in courses {
        let found = run(&settings(), fresh(), step_secs, None);
        let ratio = found.secs / DEADLINE_SECS;
        println!("{name}: {ratio:.3}, {:?}", found.plan);
        assert!((ratio - 1.0).abs() < 0.15, "{name}: {ratio}");
        // A round that finds nothing to prune leaves no trace but in the timetable.
        let (last, views) = (found.state.step, photos(&scene()).indices(Split::Train).len());
        let of =
            |step| Schedule::of_run(&TrainConfig { plan: found.plan.clone(), ..settings() }, views, step);
        assert!(of(last).is_pruned(last) && !of(last / 2).is_pruned(last / 2), "{name}: pruning finishes");
        assert!(!found.state.history.pruned.is_empty(), "{name}");
        let after_tenth = || found.etas.iter().filter(|(share, _)| (0.1..0.97).contains(share));
        let worst = after_tenth().map(|(_, ratio)| ratio.ln().abs()).fold(0.0, f64::max);
        println!("{name}: ETA within a factor of {:.2}", worst.exp());
        assert!(worst.exp() < 2.0 && after_tenth().count() > 50, "{name}: ETA off by {}", worst.exp());
    }
    // Control: the same steps without decisions miss the deadline.
    let fixed: f64 = (1..=STEPS).map(|n| if n < 100 { 0.9 } else { 1.8 }).sum();
    assert!(fixed > 1.03 * DEADLINE_SECS, "{fixed}");
}

#[test]
fn the_plan_repeats_a_run_without_a_clock_and_after_an_interruption() {
    let growing = |n: u32| 0.6 + f64::from(n) / 200.0;
    let repeated = |plan: &[LengthChange]| {
        let config = TrainConfig { plan: plan.to_vec(), ..settings() };
        let mut backend = CpuBackend::new(Some(2)).unwrap();
        let views = photos(&scene());
        let mut sink = |_: TrainEvent<'_>| Ok(Control::Continue);
        train(&config, &mut backend, &views, fresh().0, &mut sink).unwrap().0
    };
    let whole = run(&settings(), fresh(), &growing, None);
    assert!(whole.plan.len() > 3 && whole.state.step == whole.plan.last().unwrap()[1], "{:?}", whole.plan);
    let again = repeated(&whole.plan);
    assert!(again.model == whole.state.model && again.adam == whole.state.adam);
    // Negative control: another plan is another model.
    assert!(repeated(&whole.plan[..2]).model != whole.state.model);
    // Interrupted and continued by the clock, whose time before counts.
    let first = run(&settings(), fresh(), &growing, Some(110));
    let (state, plan, gone) = first.stopped.unwrap();
    let rest = run(&TrainConfig { plan, ..settings() }, (state, gone), &growing, None);
    assert!((rest.secs / DEADLINE_SECS - 1.0).abs() < 0.15, "{} {:?}", rest.secs, rest.plan);
    assert!(repeated(&rest.plan).model == rest.state.model, "as the same plan uninterrupted");
}

#[test]
fn a_minute_of_training_at_most_is_lost_by_a_crash() {
    let of = |save_secs, save_every| {
        let config = TrainConfig { save_secs, save_every, ..settings() };
        run(&config, fresh(), &|n| if n < 50 { 0.5 } else { 1.5 }, None)
    };
    let (saved, never) = (of(60, 0), of(0, 0));
    let times: Vec<f64> =
        [0.0].into_iter().chain(saved.interim_secs.iter().copied()).chain([saved.secs]).collect();
    // It can be saved after a step, but not within the decisions after it: a round of pruning renders many views.
    let between = |times: &[f64]| times.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    let [apart, step] = [&times, &saved.step_secs].map(|times| between(times));
    println!("at most {apart} s between checkpoints, {step} s between steps");
    assert!(times.len() > 4 && apart < 60.0 + step, "{times:?}");
    // Negative control: without interim checkpoints, all is lost until the end.
    assert!(never.interim_secs.is_empty() && never.secs > 60.0 + between(&never.step_secs));
    assert!(saved.state.model == never.state.model && saved.state.adam == never.state.adam);
    assert_eq!(saved.plan, never.plan);
    // Checkpoints that the user asks for are enough.
    assert!(of(60, 70).interim_secs.is_empty());
}

#[test]
fn a_run_that_nobody_timed_ends_with_its_steps_and_is_shortened_only_for_the_deadline() {
    let found = |deadline_secs, step_secs: f64| {
        run_within((deadline_secs, STEPS), &settings(), fresh(), &|_| step_secs, None)
    };
    let early = found(4.0 * DEADLINE_SECS, 1.0);
    assert_eq!(early.state.step, STEPS, "{:?}", early.plan);
    assert!(early.secs < 1.2 * DEADLINE_SECS, "{}", early.secs);
    // On a machine that is slower than expected, too, while there is time.
    assert_eq!(found(4.0 * DEADLINE_SECS, 2.5).state.step, STEPS);
    let late = found(DEADLINE_SECS, 1.8);
    assert!(late.state.step < STEPS && (late.secs / DEADLINE_SECS - 1.0).abs() < 0.15, "{} s", late.secs);
    // Negative control: without the bound the run fills the time.
    let filled = run(&settings(), fresh(), &|_| 0.7, None);
    assert!(filled.state.step > STEPS, "{:?}", filled.plan);
    // The ETA is that of the steps, not of the deadline.
    let after_tenth = early.etas.iter().filter(|(share, _)| (0.1..0.97).contains(share));
    let worst = after_tenth.map(|(_, ratio)| ratio.ln().abs()).fold(0.0, f64::max);
    assert!(worst.exp() < 2.0, "ETA off by {}", worst.exp());
}
