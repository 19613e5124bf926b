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
use litetex_gs::train::{
    Control, DeviceBound, GROWTH_ENDED, Policy, SMALLER_IMAGES, StopReason, TrainConfig, TrainEvent,
    TrainState, checkpoint, train,
};
use litetex_gs::{Error, Result};
use std::collections::BTreeMap;

/// What a device has room for.
#[derive(Clone, Copy)]
struct Room {
    /// Pairs of a step.
    pairs: u64,
    /// Splats of a model after a plan.
    splats: usize,
    /// Readings of the model, counted from 1, for which there is none.
    refused_reading: usize,
    /// Whether there is room for images.
    images: bool,
}

const PLENTY: Room = Room { pairs: u64::MAX, splats: usize::MAX, refused_reading: 0, images: true };

/// The CPU backend with little room.
struct Small {
    inner: CpuBackend,
    room: Room,
    batch: usize,
    readings: usize,
}

fn no_room<T>(what: &str) -> Result<T> {
    Err(Error::DeviceFull(format!("small: {what}")))
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
        self.inner.save()
    }
    fn restore(&mut self, saved: &SavedState) -> Result<()> {
        self.inner.restore(saved)
    }
    fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>> {
        self.inner.probe(probes)
    }
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        if self.room.images { self.inner.render(camera, options) } else { no_room("image") }
    }
    fn batch_steps(&self) -> usize {
        self.batch
    }
    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
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
        self.inner.read_statistics()
    }
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        self.inner.set_statistics(statistics)
    }
    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        if plan.sources.len() > self.room.splats { no_room("plan") } else { self.inner.apply_plan(plan) }
    }
    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        self.inner.read_back()
    }
    fn read_flushed(&mut self) -> Result<Model> {
        self.readings += 1;
        if self.readings == self.room.refused_reading {
            no_room("reading")
        } else {
            self.inner.read_flushed()
        }
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
    let mut backend = Small { inner: CpuBackend::new(Some(2)).unwrap(), room, batch, readings: 0 };
    let mut out = Outcome {
        state: start.clone(),
        saved: Vec::new(),
        splats: 0,
        pairs: 0,
        steps: Vec::new(),
        warnings: Vec::new(),
    };
    let (state, reason) = train(&growing(), &mut backend, views, start, &mut |event| {
        match event {
            TrainEvent::Step { step, report, .. } => {
                out.steps.push(step);
                out.pairs = out.pairs.max(report.counters.tile_pairs);
            }
            TrainEvent::DensityControl { size, .. } => out.splats = out.splats.max(size.splats),
            TrainEvent::Warning(warning) => out.warnings.push((warning.code, warning.message)),
            TrainEvent::Checkpoint { state, .. } => out.saved.push(state.clone()),
            _ => {}
        }
        Ok(Control::Continue)
    })
    .unwrap();
    assert_eq!(reason, StopReason::Steps);
    out.state = state;
    out
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
    // A reading is refused by its number, which a resumed run counts anew.
    if room.refused_reading == 0 {
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
    let out = check(Room { refused_reading: 3, ..PLENTY }, &[GROWTH_ENDED]);
    assert!(out.splats < unbounded().splats);
    // No room for images of 32 pixels either: the error remains.
    let scene = scene();
    let room = Room { pairs: 1, ..PLENTY };
    let mut backend = Small { inner: CpuBackend::new(Some(2)).unwrap(), room, batch: 1, readings: 0 };
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
}
