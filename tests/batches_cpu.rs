//! Batches of steps give the same results as single steps: states, events, and checkpoints after failures within a
//! batch.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::training::{MemoryViews, config, damaged, photos, scene};
use litetex_gs::backend::{
    Backend, Costs, DensityPlan, DeviceInfo, DeviceLimits, Probe, RenderOptions, RenderedImage, SavedState,
    SceneShape, StepReport, StepRequest, WindowStatistics,
};
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::train::{
    Control, NO_SNAPSHOT, Policy, StopReason, TrainConfig, TrainEvent, TrainState, checkpoint, train,
};
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A fault injected into batches.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// Exchanges the first two views of each batch.
    Swap,
    /// The device fails at this step.
    At(u32),
    /// The loss of this step is NaN.
    NotFinite(u32),
    /// The device fails when the model is read for this density-control step, counted from 1.
    Revision(usize),
}

/// The CPU backend with batches of a given size, and a fault.
struct BatchedBackend {
    inner: CpuBackend,
    size: usize,
    fault: Fault,
    /// Sizes of the batches so far.
    sizes: Vec<usize>,
    /// Density-control steps so far.
    revisions: usize,
}

impl BatchedBackend {
    fn new(size: usize, fault: Fault) -> Self {
        Self { inner: CpuBackend::new(Some(2)).unwrap(), size, fault, sizes: Vec::new(), revisions: 0 }
    }
}

impl Backend for BatchedBackend {
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
        self.inner.probe(probes)
    }
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        self.inner.render(camera, options)
    }
    fn step(&mut self, _: &StepRequest<'_>) -> Result<StepReport> {
        unreachable!("the trainer passes batches")
    }
    fn batch_steps(&self) -> usize {
        self.size
    }
    fn steps(&mut self, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        self.sizes.push(requests.len());
        let mut from: Vec<usize> = (0..requests.len()).collect();
        if self.fault == Fault::Swap && from.len() > 1 {
            from.swap(0, 1);
        }
        let mut one = |(request, from): (&StepRequest<'_>, usize)| {
            if self.fault == Fault::At(request.step) {
                return Err(Error::Device("lost".into()));
            }
            let StepRequest { camera, photo, target, .. } = requests[from];
            let mut report = self.inner.step(&StepRequest { camera, photo, target, ..*request })?;
            if self.fault == Fault::NotFinite(request.step) {
                report.loss.total = f64::NAN;
            }
            Ok(report)
        };
        requests.iter().zip(from).map(&mut one).collect()
    }
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        self.inner.set_statistics(statistics)
    }

    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        self.inner.read_statistics()
    }
    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        self.inner.apply_plan(plan)
    }
    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        self.inner.read_back()
    }
    fn read_flushed(&mut self) -> Result<Model> {
        self.revisions += 1;
        if self.fault == Fault::Revision(self.revisions) {
            return Err(Error::Device("lost".into()));
        }
        self.inner.read_flushed()
    }
}

/// Results of a training run.
struct RunRecord {
    outcome: Result<(TrainState, StopReason)>,
    /// One line per event, without times.
    events: Vec<String>,
    saved: Vec<TrainState>,
    /// Wall and CPU seconds after each step.
    times: Vec<[f64; 2]>,
}

impl RunRecord {
    /// The checkpoints as files.
    fn files(&self) -> Vec<Vec<u8>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.safetensors");
        let file = |state: &TrainState| {
            checkpoint::save(&path, state, &state.history, &BTreeMap::new()).unwrap();
            std::fs::read(&path).unwrap()
        };
        self.saved.iter().map(file).collect()
    }
}

fn settings() -> TrainConfig {
    TrainConfig { eval_every: 12, save_every: 9, ..config(37) }
}

/// Starts within an epoch, so that the 5 steps up to a density-control step draw from two epochs.
fn start() -> TrainState {
    TrainState {
        epoch_order: vec![3, 1, 5, 2, 4],
        epoch_used: 3,
        epochs: 1,
        ..TrainState::fresh(damaged(&scene()))
    }
}

fn run(backend: &mut dyn Backend, views: &dyn ViewSource, start: TrainState, stop_at: u32) -> RunRecord {
    run_with(&settings(), backend, views, start, stop_at)
}

fn run_with(
    config: &TrainConfig,
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    start: TrainState,
    stop_at: u32,
) -> RunRecord {
    let (mut events, mut saved, mut times) = (Vec::new(), Vec::new(), Vec::new());
    let mut sink = |event: TrainEvent<'_>| {
        let mut control = Control::Continue;
        events.push(match event {
            TrainEvent::Started { step, steps, .. } => format!("started {step} {steps}"),
            TrainEvent::Step {
                step,
                view,
                loss,
                report,
                size,
                train_wall_secs,
                train_cpu_secs,
                remaining_secs: _,
            } => {
                times.push([train_wall_secs, train_cpu_secs]);
                if step == stop_at {
                    control = Control::Stop;
                }
                let (c, n) = (&report.counters, report.non_finite_gradients);
                format!("step {step} {view} {loss:?} {c:?} {n} {size:?}")
            }
            TrainEvent::Planned { .. } => "planned".to_owned(),
            TrainEvent::EvalView { step, view, image } => {
                format!("view {step} {view} {:?}", &image.rgb[..99])
            }
            TrainEvent::DensityControl { step, counts, size, .. } => {
                format!("density control {step} {counts:?} {size:?}")
            }
            TrainEvent::Pruned(pruned) => format!("{pruned:?}"),
            TrainEvent::Evaluated { step, evaluation, point, last } => {
                format!("evaluated {step} {} {evaluation:?} {last}", point.psnr_test)
            }
            TrainEvent::Checkpoint { state, .. } => {
                saved.push(state.clone());
                format!("checkpoint {}", state.step)
            }
            TrainEvent::Warning(warning) => format!("{warning:?}"),
            TrainEvent::Snapshot { step, .. } => format!("snapshot {step}"),
            TrainEvent::Finished { reason } => format!("finished {reason:?}"),
        });
        Ok(control)
    };
    let outcome = train(config, backend, views, start, &mut sink);
    RunRecord { outcome, events, saved, times }
}

fn plain(views: &MemoryViews) -> RunRecord {
    run(&mut CpuBackend::new(Some(2)).unwrap(), views, start(), 0)
}

#[test]
fn batches_give_the_same_files_and_events() {
    let views = photos(&scene());
    let single = plain(&views);
    let files = single.files();
    let steps: Vec<u32> = single.saved.iter().map(|s| s.step).collect();
    assert_eq!(steps, [9, 18, 27, 36, 37, 37]);
    let maps = |i: usize| &single.saved[i].model.textures.maps;
    assert!(maps(0) != maps(1), "no map changed between two checkpoints: nothing was tested");
    // Batches end at 5, 9 (checkpoint), 10 (density control), 12 (evaluation), 15, 18, 20, 24, 25, 27, 30, 35,
    // 36, 37.
    let expected = [5, 4, 1, 2, 3, 3, 2, 4, 1, 2, 3, 5, 1, 1];
    for (size, sizes) in [(0, &[1; 37][..]), (1, &[1; 37]), (5, &expected), (16, &expected)] {
        let mut backend = BatchedBackend::new(size, Fault::None);
        let batched = run(&mut backend, &views, start(), 0);
        assert_eq!(backend.sizes, sizes);
        assert_eq!(batched.events, single.events, "batches of {size}");
        assert!(batched.files() == files, "batches of {size}");
    }
    let mut backend = BatchedBackend::new(3, Fault::None);
    assert!(run(&mut backend, &views, start(), 0).files() == files);
    assert_eq!(backend.sizes[..4], [3, 2, 3, 1], "batches shorter than the interval of density control");
    // Negative control: two views of a batch exchanged.
    let swapped = run(&mut BatchedBackend::new(5, Fault::Swap), &views, start(), 0);
    assert!(swapped.events != single.events && swapped.files()[0] != files[0]);
}

#[test]
fn snapshots_come_after_batches_and_may_fail() {
    let views = photos(&scene());
    let whole = plain(&views);
    // The density-control step after step 5 reads the model first.
    for (fault, expected) in [(Fault::None, (vec![5], 0)), (Fault::Revision(2), (vec![], 1))] {
        let (mut taken, mut failed) = (Vec::new(), 0);
        let mut sink = |event: TrainEvent<'_>| {
            match event {
                TrainEvent::Step { step: 2, .. } => return Ok(Control::Snapshot),
                TrainEvent::Snapshot { step, .. } => taken.push(step),
                TrainEvent::Warning(warning) => failed += usize::from(warning.code == NO_SNAPSHOT),
                _ => {}
            }
            Ok(Control::Continue)
        };
        let mut backend = BatchedBackend::new(5, fault);
        let (state, _) = train(&settings(), &mut backend, &views, start(), &mut sink).unwrap();
        assert!(state.model == whole.saved.last().unwrap().model);
        assert_eq!((taken, failed), expected);
    }
}

#[test]
fn resuming_between_batches_continues_bit_for_bit() {
    let views = photos(&scene());
    let single = plain(&views);
    for at in &single.saved[..4] {
        let resumed = run(&mut BatchedBackend::new(4, Fault::None), &views, at.clone(), 0);
        assert!(resumed.files().last() == single.files().last(), "from step {}", at.step);
    }
}

#[test]
fn the_time_of_a_batch_is_shared_evenly_by_its_steps() {
    let views = photos(&scene());
    let record = run(&mut BatchedBackend::new(5, Fault::None), &views, start(), 0);
    let history = &record.outcome.unwrap().0.history;
    assert_eq!(record.times.len(), 37);
    assert_eq!(record.times[36], [history.train_wall_secs, history.train_cpu_secs]);
    assert!(record.times.windows(2).all(|w| w[0][0] < w[1][0] && w[0][1] <= w[1][1]), "{:?}", record.times);
    // The first batch has five steps.
    let share = record.times[1][0] - record.times[0][0];
    assert!((record.times[4][0] - record.times[0][0] - 4.0 * share).abs() < 1e-12 && share > 0.0);
    // A checkpoint includes the time of all its steps.
    assert_eq!(record.saved[0].history.train_wall_secs, record.times[8][0]);
}

#[test]
fn a_stop_within_a_batch_takes_effect_at_the_end_of_the_batch() {
    let views = photos(&scene());
    let single = plain(&views);
    let record = run(&mut BatchedBackend::new(5, Fault::None), &views, start(), 7);
    let (state, reason) = record.outcome.as_ref().unwrap();
    assert_eq!((state.step, *reason), (9, StopReason::Consumer));
    assert_eq!(record.events[..11], single.events[..11], "started, nine steps, a density-control step");
    assert_eq!(record.events[11..], ["checkpoint 9", "finished Consumer"]);
    assert!(record.files()[0] == single.files()[0]);
}

#[test]
fn after_a_device_failure_within_a_batch_training_can_be_resumed() {
    let views = photos(&scene());
    let single = plain(&views);
    // The batches are steps 1 to 5, 6 to 9, 10, 11 and 12; the first has views of two epochs.
    for at in [1, 3, 4, 5, 6, 8, 12] {
        let record = run(&mut BatchedBackend::new(5, Fault::At(at)), &views, start(), 0);
        assert!(matches!(&record.outcome, Err(Error::Device(message)) if message == "lost"));
        let last = record.saved.last().unwrap();
        assert_eq!((last.step, last.adam.step), (at - 1, at - 1));
        let resumed = run(&mut BatchedBackend::new(5, Fault::None), &views, last.clone(), 0);
        assert!(resumed.files().last() == single.files().last(), "from step {}", last.step);
    }
}

#[test]
fn a_failed_round_of_giving_back_loses_nothing_and_is_not_repeated() {
    let views = photos(&scene());
    let run = |fault, from: &TrainState| run(&mut BatchedBackend::new(5, fault), &views, from.clone(), 0);
    // The seventh plan, after those of six density-control steps.
    let record = run(Fault::Revision(7), &start());
    assert!(record.outcome.is_err());
    let last = record.saved.last().unwrap();
    assert_eq!((last.step, last.adam.step, last.revised_step), (30, 30, 30));
    // Restored: probes leave moments of zero.
    assert!(last.adam.texels_v.iter().any(|&v| v > 0.0));
    assert!(run(Fault::None, last).outcome.is_ok());
}

#[test]
fn a_failed_density_control_step_is_repeated_on_resume() {
    let views = photos(&scene());
    // Density control every 5 steps; then every 100 steps, with maps cropped and padded every 40.
    let mut cropping = TrainConfig { eval_every: 0, save_every: 0, ..config(125) };
    (cropping.policy, cropping.density.interval) = (Policy::Paper, Some(24_000));
    let cases = [(settings(), &[5, 10, 15, 20, 25, 30, 35][..]), (cropping, &[40, 80, 100, 120])];
    for (mut config, due) in cases {
        config.density.prune_db = 0.0;
        let run = |fault, from: &TrainState| {
            run_with(&config, &mut BatchedBackend::new(5, fault), &views, from.clone(), 0)
        };
        let whole = run(Fault::None, &start());
        let mut revisions = 0;
        for (nth, &step) in (1..).zip(due) {
            let record = run(Fault::Revision(nth), &start());
            assert!(record.outcome.is_err(), "{step}");
            let last = record.saved.last().unwrap();
            assert_eq!(last.step, step);
            assert!(run(Fault::None, last).files().last() == whole.files().last(), "from step {step}");
            // Negative control: skips the density-control step.
            let skipped = TrainState { revised_step: step, ..last.clone() };
            revisions += usize::from(run(Fault::None, &skipped).files().last() != whole.files().last());
        }
        assert!(revisions > 1, "density control changed nothing: nothing was tested");
    }
}

#[test]
fn a_loss_that_is_not_finite_is_detected_within_a_batch() {
    let views = photos(&scene());
    let single = plain(&views);
    let record = run(&mut BatchedBackend::new(5, Fault::NotFinite(8)), &views, start(), 0);
    let message = record.outcome.as_ref().unwrap_err().to_string();
    assert!(message.contains("step 8: the loss is NaN"), "{message}");
    // The steps before it are reported; the checkpoint is from the end of its batch.
    assert_eq!(record.events[..9], single.events[..9]);
    assert_eq!(record.events[9..], ["checkpoint 9"]);
    assert_eq!((record.saved[0].step, record.saved[0].adam.step), (9, 9));
}

/// Views of which the photo of a training view cannot be read.
struct Unreadable<'a>(&'a MemoryViews, usize);

impl ViewSource for Unreadable<'_> {
    fn num_views(&self) -> usize {
        self.0.num_views()
    }
    fn name(&self, view: usize) -> &str {
        self.0.name(view)
    }
    fn split(&self, view: usize) -> Split {
        self.0.split(view)
    }
    fn camera(&self, view: usize) -> Camera {
        self.0.camera(view)
    }
    fn target(&self, view: usize) -> Result<Arc<litetex_gs::backend::TargetImage>> {
        if view == self.1 { Err(Error::invalid("photo.png", "cut off")) } else { self.0.target(view) }
    }
}

#[test]
fn an_unreadable_photo_within_a_batch_loses_no_earlier_step() {
    let views = photos(&scene());
    let single = plain(&views);
    let drawn = |event: &String| event.split(' ').nth(2).unwrap().parse::<usize>().unwrap();
    let order: Vec<usize> = single.events[1..=5].iter().map(drawn).collect();
    for size in [1, 5] {
        // The third photo in the order of training.
        let unreadable = Unreadable(&views, order[2]);
        let record = run(&mut BatchedBackend::new(size, Fault::None), &unreadable, start(), 0);
        assert!(matches!(record.outcome, Err(Error::InvalidInput { .. })));
        assert_eq!(record.events[..3], single.events[..3], "two steps");
        let last = record.saved.last().unwrap();
        assert_eq!(last.step, 2);
        let resumed = run(&mut BatchedBackend::new(size, Fault::None), &views, last.clone(), 0);
        assert!(resumed.files().last() == single.files().last());
    }
}
