//! A run that outgrows its device stops growing, reduces its images where a step does not fit, says so once, and goes on: on the
//! CPU backend with artificial limits.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::training::{MemoryViews, config, damaged, photos, scene_options};
use litetex_gs::backend::{
    Backend, Costs, DensityPlan, DeviceInfo, DeviceLimits, LearningRates, LossWeights, Probe, RenderOptions,
    RenderedImage, SavedState, SceneShape, StepReport, StepRequest, WindowStatistics,
};
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};
use litetex_gs::train::density::Budget;
use litetex_gs::train::{
    Control, DeviceBound, GROWTH_ENDED, Policy, SMALLER_IMAGES, Schedule, StopReason, TrainConfig,
    TrainEvent, TrainState, checkpoint, train,
};
use litetex_gs::{Error, NoRoom, Result};
use std::collections::BTreeMap;

/// What may be refused by its number.
#[derive(Clone, Copy, PartialEq)]
enum Call {
    Save,
    ReadBack,
    ReadStatistics,
    ReadFlushed,
    Restore,
    Probe,
    Render,
    SetStatistics,
}

/// What a device has room for.
#[derive(Clone, Copy)]
struct Room {
    /// Pairs of a step.
    pairs: u64,
    /// Splats of a model after a plan.
    splats: usize,
    /// Calls for which there is none, from one number to another, counted from 1.
    refused: Option<(Call, [usize; 2])>,
    /// Whether there is room for images.
    images: bool,
}

const PLENTY: Room = Room { pairs: u64::MAX, splats: usize::MAX, refused: None, images: true };

/// The CPU backend with little room.
struct Small {
    inner: CpuBackend,
    room: Room,
    batch: usize,
    /// Calls of the kind that is refused.
    calls: usize,
    /// Smaller side of the smallest images of a step.
    side_px: u32,
    /// Whether there is no model, since a state could not be restored.
    is_lost: bool,
}

impl Small {
    fn new(room: Room, batch: usize) -> Self {
        Self {
            inner: CpuBackend::new(Some(2)).unwrap(),
            room,
            batch,
            calls: 0,
            side_px: u32::MAX,
            is_lost: false,
        }
    }

    /// Refuses a call whose number is among those refused.
    fn check(&mut self, call: Call) -> Result<()> {
        match self.room.refused {
            Some((refused, [first, last])) if refused == call => {
                self.calls += 1;
                if (first..=last).contains(&self.calls) { no_room("reading") } else { Ok(()) }
            }
            _ => Ok(()),
        }
    }
}

fn no_room<T>(what: &str) -> Result<T> {
    Err(Error::DeviceFull(NoRoom { what: format!("small: {what}"), remedy: Some("use less") }))
}

impl Backend for Small {
    fn device(&self) -> DeviceInfo {
        DeviceInfo { name: "small".into(), ..self.inner.device() }
    }
    fn limits(&self, shape: SceneShape) -> DeviceLimits {
        DeviceLimits { max_pairs: self.room.pairs, ..self.inner.limits(shape) }
    }
    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        self.inner.upload(model, adam)
    }
    fn save(&mut self) -> Result<SavedState> {
        self.check(Call::Save)?;
        self.inner.save()
    }
    fn restore(&mut self, saved: &SavedState) -> Result<()> {
        self.is_lost = true;
        self.check(Call::Restore)?;
        self.is_lost = false;
        self.inner.restore(saved)
    }
    fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>> {
        self.check(Call::Probe)?;
        self.inner.probe(probes)
    }
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        self.check(Call::Render)?;
        if self.room.images { self.inner.render(camera, options) } else { no_room("image") }
    }
    fn batch_steps(&self) -> usize {
        self.batch
    }
    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
        let pinhole = request.camera.pinhole;
        self.side_px = self.side_px.min(pinhole.width_px).min(pinhole.height_px);
        let (before, window) = (self.inner.save()?, self.inner.read_statistics()?);
        let report = self.inner.step(request)?;
        if report.counters.tile_pairs <= self.room.pairs {
            return Ok(report);
        }
        self.inner.restore(&before)?;
        self.inner.set_statistics(&window)?;
        no_room("too many pairs")
    }
    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        self.check(Call::ReadStatistics)?;
        self.inner.read_statistics()
    }
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        // An empty window needs no room.
        if statistics.views > 0 {
            self.check(Call::SetStatistics)?;
        }
        self.inner.set_statistics(statistics)
    }
    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        if plan.sources.len() > self.room.splats { no_room("plan") } else { self.inner.apply_plan(plan) }
    }
    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        self.check(Call::ReadBack)?;
        if self.is_lost {
            return Err(Error::Usage("small: no model".into()));
        }
        self.inner.read_back()
    }
    fn read_flushed(&mut self) -> Result<Model> {
        self.check(Call::ReadFlushed)?;
        self.inner.read_flushed()
    }
}

/// Fewer and smaller splats than in the common scene, so that there is room to grow, on images of several tiles.
fn scene() -> RandomScene {
    let options = SceneOptions { num_splats: 150, scales: (0.03, 0.1), ..scene_options() };
    random_scene(&SceneOptions { width_px: 160, height_px: 120, ..options })
}

/// Settings for the fastest growth, without pruning.
fn growing() -> TrainConfig {
    let mut config = TrainConfig { policy: Policy::Litetex, save_every: 7, eval_every: 0, ..config(60) };
    config.components.growth = false;
    config.density.quantile = 0.1;
    config.density.min_texel_px = 0.2;
    config.density.prune_db = 0.0;
    config
}

struct Outcome {
    state: TrainState,
    saved: Vec<TrainState>,
    /// Most splats after any density-control step.
    splats: usize,
    /// Most pairs of any step.
    pairs: u64,
    steps: Vec<u32>,
    warnings: Vec<(String, String)>,
}

impl Outcome {
    fn codes(&self) -> Vec<&str> {
        self.warnings.iter().map(|(code, _)| code.as_str()).collect()
    }

    /// The last state as a file, without times.
    fn file(&self) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.safetensors");
        checkpoint::save(&path, &self.state, &self.state.history, &BTreeMap::new()).unwrap();
        std::fs::read(&path).unwrap()
    }
}

fn run(room: Room, batch: usize, views: &MemoryViews, start: TrainState) -> Outcome {
    run_with(&growing(), room, batch, views, start)
}

fn run_with(
    config: &TrainConfig,
    room: Room,
    batch: usize,
    views: &MemoryViews,
    start: TrainState,
) -> Outcome {
    let (out, ended) = attempt(config, room, batch, views, start);
    assert_eq!(ended.unwrap(), StopReason::Steps);
    out
}

/// A run that may fail; its state is then that of the start.
fn attempt(
    config: &TrainConfig,
    room: Room,
    batch: usize,
    views: &MemoryViews,
    start: TrainState,
) -> (Outcome, Result<StopReason>) {
    let mut backend = Small::new(room, batch);
    let mut out = Outcome {
        state: start.clone(),
        saved: Vec::new(),
        splats: 0,
        pairs: 0,
        steps: Vec::new(),
        warnings: Vec::new(),
    };
    let ended = train(config, &mut backend, views, start, &mut |event| {
        match event {
            TrainEvent::Step { step, report, .. } => {
                out.steps.push(step);
                out.pairs = out.pairs.max(report.counters.tile_pairs);
            }
            TrainEvent::DensityControl { size, .. } => out.splats = out.splats.max(size.splats),
            TrainEvent::Warning(warning) => {
                // It has a remedy of its own, for a run that goes on.
                assert!(!warning.message.contains("use less"), "{}", warning.message);
                out.warnings.push((warning.code, warning.message));
            }
            TrainEvent::Checkpoint { state, .. } => out.saved.push(state.clone()),
            _ => {}
        }
        Ok(Control::Continue)
    });
    let reason = ended.map(|(state, reason)| {
        out.state = state;
        reason
    });
    (out, reason)
}

/// A run in a room goes to its last step with one warning, is the same in batches of any size, and can be resumed from anywhere.
fn check(room: Room, codes: &[&str]) -> Outcome {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    let out = run(room, 1, &views, start.clone());
    assert_eq!(out.codes(), codes, "{:?}", out.warnings);
    assert_eq!(out.steps, (1..=60).collect::<Vec<_>>());
    let same = |other: &Outcome| other.file() == out.file();
    assert!(same(&run(room, 5, &views, start)), "batches");
    // A resumed run counts the calls anew.
    if room.refused.is_none() {
        let ended = out.saved.iter().filter(|at| at.device.ended_step > 0 || at.device.least_scale > 1.0);
        assert!((1..out.saved.len() + 1).contains(&ended.count()));
        for at in &out.saved {
            assert!(same(&run(room, 3, &views, at.clone())), "from step {}", at.step);
        }
    }
    out
}

fn unbounded() -> Outcome {
    let scene = scene();
    let out = run(PLENTY, 4, &photos(&scene), TrainState::fresh(damaged(&scene)));
    assert!(out.warnings.is_empty() && out.state.device.ended_step == 0);
    out
}

#[test]
fn growth_that_does_not_fit_is_refused_and_the_run_goes_on() {
    let plenty = unbounded();
    let most = 200;
    assert!(plenty.splats > most, "{} splats: nothing was tested", plenty.splats);
    let out = check(Room { splats: most, ..PLENTY }, &[GROWTH_ENDED]);
    assert!((150..=most).contains(&out.splats), "{}", out.splats);
    let params = out.state.device.budget.max_params.unwrap();
    let parts = ["step ", "small: plan", "--budget-params "];
    assert!(parts.iter().all(|part| out.warnings[0].1.contains(part)), "{:?}", out.warnings);
    assert!(out.state.model.num_params() <= params);
}

#[test]
fn growth_ends_before_a_step_needs_more_pairs_than_fit() {
    let plenty = unbounded();
    let first = first_pairs();
    // Half of what growth adds.
    let pairs = u64::midpoint(first, plenty.pairs);
    let out = check(Room { pairs, ..PLENTY }, &[GROWTH_ENDED]);
    println!("{first} pairs at first, {} of {pairs} at most, {} without a limit", out.pairs, plenty.pairs);
    assert!(out.pairs <= pairs && out.splats < plenty.splats && out.splats > 150);
    assert_eq!(out.state.device.least_scale, 1.0);
    assert!(out.warnings[0].1.contains("tile-splat pairs"), "{:?}", out.warnings);
}

/// Most pairs of a view of the first model.
fn first_pairs() -> u64 {
    let scene = scene();
    let (model, views) = (damaged(&scene), photos(&scene));
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    backend.upload(&model, &AdamState::zeros(&model)).unwrap();
    let request = |view: usize| StepRequest {
        step: 1,
        camera: views.0[view].0,
        photo: None,
        target: &views.0[view].1,
        background: [0.0; 3],
        sh_degree: 0,
        loss: LossWeights::default(),
        rates: LearningRates::default(),
        accumulate_statistics: false,
        exposure: None,
    };
    (1..6).map(|view| backend.step(&request(view)).unwrap().counters.tile_pairs).max().unwrap()
}

#[test]
fn images_stay_smaller_where_a_step_does_not_fit() {
    let first = first_pairs();
    // Not even the first model fits.
    let room = Room { pairs: first * 3 / 4, ..PLENTY };
    let out = check(room, &[SMALLER_IMAGES]);
    // Nor does an evaluation.
    check(Room { images: false, ..room }, &[SMALLER_IMAGES, "no-test-figures"]);
    let scale = out.state.device.least_scale;
    println!("{first} pairs at first, {} at most, render scale {scale}", out.pairs);
    assert!(out.pairs <= room.pairs && scale > 1.0 && scale < 3.0, "{scale}");
    assert_eq!(out.splats, 150);
}

#[test]
fn a_model_that_cannot_be_read_is_left_as_it_is() {
    let plenty = unbounded();
    for (call, number) in [(Call::ReadFlushed, 3), (Call::ReadStatistics, 3)] {
        let out = check(Room { refused: Some((call, [number; 2])), ..PLENTY }, &[GROWTH_ENDED]);
        assert!(out.splats < plenty.splats);
        let message = &out.warnings[0].1;
        assert!(message.contains("the model stays at ") && !message.contains("use less"), "{message}");
    }
    // No room for images of 32 pixels either: the error remains.
    let scene = scene();
    let mut backend = Small::new(Room { pairs: 1, ..PLENTY }, 1);
    let start = TrainState::fresh(damaged(&scene));
    let mut saved = Vec::new();
    let error = train(&growing(), &mut backend, &photos(&scene), start, &mut |event| {
        if let TrainEvent::Checkpoint { state, .. } = event {
            saved.push(state.device);
        }
        Ok(Control::Continue)
    });
    assert!(matches!(error, Err(Error::DeviceFull(_))));
    assert_eq!(saved, [DeviceBound::default()], "a device with more room goes on in full size");
    assert!((25..=32).contains(&backend.side_px), "{} px", backend.side_px);
}

#[test]
fn checkpoints_that_cannot_be_read_are_left_out() {
    let plenty = unbounded();
    // Density control reads the statistics first, after step 5.
    for (call, numbers, left_out) in
        [(Call::ReadBack, [1, 3], 3), (Call::ReadStatistics, [2, 2], 1), (Call::ReadBack, [8, 8], 1)]
    {
        let out = check(
            Room { refused: Some((call, numbers)), ..PLENTY },
            &["checkpoint-not-saved"].repeat(left_out),
        );
        assert_eq!(out.saved.len() + left_out, plenty.saved.len());
        assert!(out.file() == plenty.file(), "the run is the same");
        assert!(out.warnings[0].1.contains("another --device"), "{:?}", out.warnings);
    }
}

#[test]
fn rounds_of_pruning_that_do_not_fit_are_left_out() {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    let most = start.model.num_params();
    for budget in [None, Some(most)] {
        let mut config = growing();
        config.density.prune_db = TrainConfig::default().density.prune_db;
        config.budget.max_params = budget;
        let of = |numbers| {
            let room = Room { refused: Some((Call::Save, numbers)), ..PLENTY };
            run_with(&config, room, 3, &views, start.clone())
        };
        let plenty = of([0; 2]);
        assert!(plenty.warnings.is_empty(), "{:?}", plenty.warnings);
        let rounds = plenty.state.history.pruned.len();
        let (one, all) = (of([1; 2]), of([1, usize::MAX]));
        assert_eq!(one.codes(), ["not-pruned"]);
        assert!(rounds > 1 && all.codes() == ["not-pruned"].repeat(rounds), "{rounds}: {:?}", all.warnings);
        assert!(one.state.history.pruned.len() < rounds && all.state.history.pruned.is_empty());
        let params = |out: &Outcome| out.state.model.num_params();
        println!("{budget:?}: {}, {}, {} parameters", params(&plenty), params(&one), params(&all));
        assert!(params(&one) < params(&all));
        if let Some(most) = budget {
            // The last round makes up for the one left out. Without any, maps may still become small enough.
            assert!(params(&plenty) <= most && params(&one) <= most);
        }
        assert_eq!(all.steps.len(), 60);
    }
}

#[test]
fn a_round_refused_in_its_middle_leaves_the_state_of_before() {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    let mut config = growing();
    config.density.prune_db = TrainConfig::default().density.prune_db;
    let room = |call, last| Room { refused: Some((call, [1, last])), ..PLENTY };
    let of = |call| run_with(&config, room(call, 1), 3, &views, start.clone());
    let not_begun = of(Call::Save);
    for call in [Call::Probe, Call::Render, Call::Restore] {
        let out = of(call);
        assert_eq!(out.codes(), ["not-pruned"]);
        assert!(out.file() == not_begun.file(), "as if the round had not begun");
    }
    // Negative control.
    let plenty = run_with(&config, PLENTY, 3, &views, start.clone());
    assert!(plenty.file() != not_begun.file());

    // A state that cannot be restored is not saved either: the checkpoint before it stays.
    let (out, ended) = attempt(&config, room(Call::Restore, usize::MAX), 3, &views, start.clone());
    assert!(matches!(ended, Err(Error::Device(_))), "{ended:?}");
    let saved = out.saved.last().unwrap();
    assert_eq!(saved.histories.len(), saved.model.num_splats());
    assert!(run_with(&config, PLENTY, 3, &views, saved.clone()).file() == plenty.file());
}

#[test]
fn a_statistics_window_that_does_not_fit_begins_anew() {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    // Until growth starts, density-control steps leave the window as it is.
    let mut config = growing();
    config.density.start = 15_000;
    let of = |refused| run_with(&config, Room { refused, ..PLENTY }, 3, &views, start.clone());
    let out = of(Some((Call::SetStatistics, [3, 3])));
    assert!(out.warnings.is_empty() && out.steps.len() == 60);
    assert!(out.file() != of(None).file(), "negative control: a window was refused");
}

#[test]
fn the_budget_of_the_warning_keeps_within_the_device() {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    let mut config = growing();
    config.density.prune_db = TrainConfig::default().density.prune_db;
    let room = Room { splats: 200, ..PLENTY };
    let of = |config: &TrainConfig| run_with(config, room, 3, &views, start.clone());
    let out = of(&config);
    assert_eq!(out.codes(), [GROWTH_ENDED]);
    let proposed = proposed_by(&out);
    config.budget = budget(proposed);
    let most = Schedule::new(&config, 5).budget(&config, 0).max_params.unwrap();
    let before = out.warnings[0].1.split_once(" parameters").unwrap().0;
    let ended: usize = before.rsplit(' ').next().unwrap().replace(',', "").parse().unwrap();
    println!("{proposed} proposed, {most} parameters in growth, which ended with {ended}");
    assert!(most <= ended && most > ended - 5, "growth may exceed the budget");
    // It is less than a budget of the user's own that did not keep within the device.
    let own = start.model.num_params();
    config.budget = budget(own);
    let out = of(&config);
    assert_eq!(out.codes(), [GROWTH_ENDED]);
    assert!(proposed_by(&out) < own, "{own}: {:?}", out.warnings);
}

fn proposed_by(out: &Outcome) -> usize {
    let after = out.warnings[0].1.split_once("--budget-params ").unwrap().1;
    after.split(' ').next().unwrap().parse().unwrap()
}

fn budget(max_params: usize) -> Budget {
    Budget { max_params: Some(max_params), ..Budget::default() }
}
