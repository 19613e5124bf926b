//! Runs on a device with little room: the CPU backend with artificial limits.

use super::sized;
use super::training::{MemoryViews, config, damaged, photos, scene_options};
use litetex_gs::backend::{
    Backend, Costs, DensityPlan, DeviceInfo, DeviceLimits, Probe, RenderOptions, RenderedImage, SavedState,
    SceneShape, StepReport, StepRequest, WindowStatistics,
};
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};
use litetex_gs::train::{Control, Policy, StopReason, TrainConfig, TrainEvent, TrainState, checkpoint};
use litetex_gs::{Error, NoRoom, Result};
use std::collections::BTreeMap;

/// What may be refused by its number.
#[derive(Clone, Copy, PartialEq)]
pub enum Call {
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
pub struct Room {
    /// Pairs of a step.
    pub pairs: u64,
    /// Splats of a model after a plan.
    pub splats: usize,
    /// Calls for which there is none, from one number to another, counted from 1.
    pub refused: Option<(Call, [usize; 2])>,
    /// Whether there is room for images.
    pub images: bool,
}

pub const PLENTY: Room = Room { pairs: u64::MAX, splats: usize::MAX, refused: None, images: true };

/// The CPU backend with little room.
pub struct Small {
    pub inner: CpuBackend,
    pub room: Room,
    pub batch: usize,
    /// Calls of the kind that is refused.
    pub calls: usize,
    /// Smaller side of the smallest images of a step.
    pub side_px: u32,
    /// Whether there is no model, since a state could not be restored.
    pub is_lost: bool,
}

impl Small {
    pub fn new(room: Room, batch: usize) -> Self {
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

pub fn no_room<T>(what: &str) -> Result<T> {
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
pub fn scene() -> RandomScene {
    let options = SceneOptions { num_splats: 150, scales: (0.03, 0.1), ..scene_options() };
    random_scene(&SceneOptions { width_px: 160, height_px: 120, ..options })
}

/// Settings for the fastest growth, without pruning.
pub fn growing() -> TrainConfig {
    let mut config = TrainConfig { policy: Policy::Litetex, save_every: 7, eval_every: 0, ..config(60) };
    config.components.growth = false;
    config.density.quantile = 0.1;
    config.density.min_texel_px = 0.2;
    config.density.prune_db = 0.0;
    config
}

pub struct Outcome {
    pub state: TrainState,
    pub saved: Vec<TrainState>,
    /// Most splats after any density-control step.
    pub splats: usize,
    /// Most pairs of any step.
    pub pairs: u64,
    pub steps: Vec<u32>,
    pub warnings: Vec<(String, String)>,
}

impl Outcome {
    pub fn codes(&self) -> Vec<&str> {
        self.warnings.iter().map(|(code, _)| code.as_str()).collect()
    }

    /// The last state as a file, without times.
    pub fn file(&self) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state.safetensors");
        checkpoint::save(&path, &self.state, &self.state.history, &BTreeMap::new()).unwrap();
        std::fs::read(&path).unwrap()
    }
}

pub fn run(room: Room, batch: usize, views: &MemoryViews, start: TrainState) -> Outcome {
    run_with(&growing(), room, batch, views, start)
}

pub fn run_with(
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
pub fn attempt(
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
    let ended = sized::attempt(&mut backend, config, views, start, &mut |event| {
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
pub fn check(room: Room, codes: &[&str]) -> Outcome {
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

pub fn unbounded() -> Outcome {
    let scene = scene();
    let out = run(PLENTY, 4, &photos(&scene), TrainState::fresh(damaged(&scene)));
    assert!(out.warnings.is_empty() && out.state.device.ended_step == 0);
    out
}
