//! Steps handed over in batches give what single steps give: states, events, and what is saved when
//! something fails in between.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::training::{MemoryViews, config, damaged, photos, scene};
use litetex_gs::backend::{
    Backend, DensityPlan, DeviceInfo, DeviceLimits, RenderOptions, RenderedImage, SceneShape, StepReport,
    StepRequest, WindowStatistics,
};
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::train::{Control, StopReason, TrainConfig, TrainEvent, TrainState, checkpoint, train};
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What goes wrong in a batch.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// The first two views of each batch are exchanged.
    Swap,
    /// The device fails when it should do this step.
    At(u32),
    /// The loss of this step is not a number.
    NotFinite(u32),
    /// The device fails when the model is read for this density-control step, counted from 1.
    Revision(usize),
}

/// The CPU backend, fed in batches.
struct Batched {
    inner: CpuBackend,
    size: usize,
    fault: Fault,
    /// Sizes of the batches so far.
    sizes: Vec<usize>,
    /// Density-control steps so far.
    revisions: usize,
}

impl Batched {
    fn new(size: usize, fault: Fault) -> Self {
        Self { inner: CpuBackend::new(Some(2)).unwrap(), size, fault, sizes: Vec::new(), revisions: 0 }
    }
}

impl Backend for Batched {
    fn device(&self) -> DeviceInfo {
        self.inner.device()
    }
    fn limits(&self, shape: SceneShape) -> DeviceLimits {
        self.inner.limits(shape)
    }
    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        self.inner.upload(model, adam)
    }
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        self.inner.render(camera, options)
    }
    fn step(&mut self, _: &StepRequest<'_>) -> Result<StepReport> {
        unreachable!("the trainer hands over batches")
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

/// What is told of a training, but for times.
struct Told {
    outcome: Result<(TrainState, StopReason)>,
    /// One line per event.
    events: Vec<String>,
    saved: Vec<TrainState>,
    /// `[wall, cpu]` seconds after each step.
    times: Vec<[f64; 2]>,
}

impl Told {
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

/// Within an epoch, so that the steps up to a revision (each 5) draw from two.
fn start() -> TrainState {
    TrainState {
        epoch_order: vec![3, 1, 5, 2, 4],
        epoch_used: 3,
        epochs: 1,
        ..TrainState::fresh(damaged(&scene()))
    }
}

fn run(backend: &mut dyn Backend, views: &dyn ViewSource, start: TrainState, stop_at: u32) -> Told {
    run_with(&settings(), backend, views, start, stop_at)
}

fn run_with(
    config: &TrainConfig,
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    start: TrainState,
    stop_at: u32,
) -> Told {
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
                num_splats,
                num_texels,
                train_wall_secs,
                train_cpu_secs,
                remaining_secs: _,
            } => {
                times.push([train_wall_secs, train_cpu_secs]);
                if step == stop_at {
                    control = Control::Stop;
                }
                let (c, n) = (&report.counters, report.non_finite_gradients);
                format!("step {step} {view} {loss:?} {c:?} {n} {num_splats} {num_texels}")
            }
            TrainEvent::EvalView { step, view, image } => {
                format!("view {step} {view} {:?}", &image.rgb[..99])
            }
            TrainEvent::DensityControl { step, counts, num_splats, num_texels, .. } => {
                format!("density control {step} {counts:?} {num_splats} {num_texels}")
            }
            TrainEvent::Evaluated { step, evaluation, point, last } => {
                format!("evaluated {step} {} {evaluation:?} {last}", point.psnr_test)
            }
            TrainEvent::Checkpoint { state } => {
                saved.push(state.clone());
                format!("checkpoint {}", state.step)
            }
            TrainEvent::Warning(warning) => format!("{warning:?}"),
            TrainEvent::Finished { reason } => format!("finished {reason:?}"),
        });
        Ok(control)
    };
    let outcome = train(config, backend, views, start, &mut sink);
    Told { outcome, events, saved, times }
}

fn plain(views: &MemoryViews) -> Told {
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
    assert!(maps(0) != maps(1), "no map was revised between two checkpoints: nothing was tested");
    // Ends at 5, 9 (saved), 10 (revised), 12 (evaluated), 15, 18, 20, 24, 25, 27, 30, 35, 36 and 37.
    let expected = [5, 4, 1, 2, 3, 3, 2, 4, 1, 2, 3, 5, 1, 1];
    for (size, sizes) in [(0, &[1; 37][..]), (1, &[1; 37]), (5, &expected), (16, &expected)] {
        let mut backend = Batched::new(size, Fault::None);
        let batched = run(&mut backend, &views, start(), 0);
        assert_eq!(backend.sizes, sizes);
        assert_eq!(batched.events, single.events, "batches of {size}");
        assert!(batched.files() == files, "batches of {size}");
    }
    let mut backend = Batched::new(3, Fault::None);
    assert!(run(&mut backend, &views, start(), 0).files() == files);
    assert_eq!(backend.sizes[..4], [3, 2, 3, 1], "batches of less than the way to a revision");
    // Negative control: two views of a batch exchanged.
    let swapped = run(&mut Batched::new(5, Fault::Swap), &views, start(), 0);
    assert!(swapped.events != single.events && swapped.files()[0] != files[0]);
}

#[test]
fn resuming_between_batches_continues_bit_for_bit() {
    let views = photos(&scene());
    let single = plain(&views);
    for at in &single.saved[..4] {
        let resumed = run(&mut Batched::new(4, Fault::None), &views, at.clone(), 0);
        assert!(resumed.files().last() == single.files().last(), "from step {}", at.step);
    }
}

#[test]
fn times_rise_in_even_shares_to_those_of_the_state() {
    let views = photos(&scene());
    let told = run(&mut Batched::new(5, Fault::None), &views, start(), 0);
    let history = &told.outcome.unwrap().0.history;
    assert_eq!(told.times.len(), 37);
    assert_eq!(told.times[36], [history.train_wall_secs, history.train_cpu_secs]);
    assert!(told.times.windows(2).all(|w| w[0][0] < w[1][0] && w[0][1] <= w[1][1]), "{:?}", told.times);
    // The first batch has five steps.
    let share = told.times[1][0] - told.times[0][0];
    assert!((told.times[4][0] - told.times[0][0] - 4.0 * share).abs() < 1e-12 && share > 0.0);
    // A checkpoint knows the time of all its steps.
    assert_eq!(told.saved[0].history.train_wall_secs, told.times[8][0]);
}

#[test]
fn a_stop_within_a_batch_takes_effect_at_its_end() {
    let views = photos(&scene());
    let single = plain(&views);
    let told = run(&mut Batched::new(5, Fault::None), &views, start(), 7);
    let (state, reason) = told.outcome.as_ref().unwrap();
    assert_eq!((state.step, *reason), (9, StopReason::Consumer));
    assert_eq!(told.events[..11], single.events[..11], "started, nine steps, a density-control step");
    assert_eq!(told.events[11..], ["checkpoint 9", "finished Consumer"]);
    assert!(told.files()[0] == single.files()[0]);
}

#[test]
fn a_device_that_fails_within_a_batch_leaves_a_state_that_continues() {
    let views = photos(&scene());
    let single = plain(&views);
    // The batches are of the steps 1 to 5, 6 to 9, 10, 11 and 12; views of two epochs are in the first.
    for at in [1, 3, 4, 5, 6, 8, 12] {
        let told = run(&mut Batched::new(5, Fault::At(at)), &views, start(), 0);
        assert!(matches!(&told.outcome, Err(Error::Device(message)) if message == "lost"));
        let last = told.saved.last().unwrap();
        assert_eq!((last.step, last.adam.step), (at - 1, at - 1));
        let resumed = run(&mut Batched::new(5, Fault::None), &views, last.clone(), 0);
        assert!(resumed.files().last() == single.files().last(), "from step {}", last.step);
    }
}

#[test]
fn a_revision_that_failed_is_done_when_the_run_goes_on() {
    let views = photos(&scene());
    // Density-control steps each 5 steps; and each 100, with maps that follow their support each 40.
    let mut cropping = TrainConfig { eval_every: 0, save_every: 0, ..config(125) };
    cropping.density.interval = 24_000;
    let cases = [(settings(), &[5, 10, 15, 20, 25, 30, 35][..]), (cropping, &[40, 80, 100, 120])];
    for (config, due) in cases {
        let run = |fault, from: &TrainState| {
            run_with(&config, &mut Batched::new(5, fault), &views, from.clone(), 0)
        };
        let whole = run(Fault::None, &start());
        let mut revisions = 0;
        for (nth, &step) in (1..).zip(due) {
            let told = run(Fault::Revision(nth), &start());
            assert!(told.outcome.is_err(), "{step}");
            let last = told.saved.last().unwrap();
            assert_eq!(last.step, step);
            assert!(run(Fault::None, last).files().last() == whole.files().last(), "from step {step}");
            // Negative control: the revision is left out.
            let skipped = TrainState { revised_step: step, ..last.clone() };
            revisions += usize::from(run(Fault::None, &skipped).files().last() != whole.files().last());
        }
        assert!(revisions > 1, "nothing was revised: nothing was tested");
    }
}

#[test]
fn a_loss_that_is_not_finite_is_found_within_a_batch() {
    let views = photos(&scene());
    let single = plain(&views);
    let told = run(&mut Batched::new(5, Fault::NotFinite(8)), &views, start(), 0);
    let message = told.outcome.as_ref().unwrap_err().to_string();
    assert!(message.contains("step 8: the loss is NaN"), "{message}");
    // The steps before it are told; what is saved is the end of its batch.
    assert_eq!(told.events[..9], single.events[..9]);
    assert_eq!(told.events[9..], ["checkpoint 9"]);
    assert_eq!((told.saved[0].step, told.saved[0].adam.step), (9, 9));
}

/// Views of which one that is trained on cannot be read.
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
fn an_unreadable_photo_within_a_batch_costs_no_step_before_it() {
    let views = photos(&scene());
    let single = plain(&views);
    let drawn = |event: &String| event.split(' ').nth(2).unwrap().parse::<usize>().unwrap();
    let order: Vec<usize> = single.events[1..=5].iter().map(drawn).collect();
    for size in [1, 5] {
        // The third photo that is drawn.
        let unreadable = Unreadable(&views, order[2]);
        let told = run(&mut Batched::new(size, Fault::None), &unreadable, start(), 0);
        assert!(matches!(told.outcome, Err(Error::InvalidInput { .. })));
        assert_eq!(told.events[..3], single.events[..3], "two steps");
        let last = told.saved.last().unwrap();
        assert_eq!(last.step, 2);
        let resumed = run(&mut Batched::new(size, Fault::None), &views, last.clone(), 0);
        assert!(resumed.files().last() == single.files().last());
    }
}
