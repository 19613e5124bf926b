//! `litetex train --view`: shows the model in the browser while it trains. Snapshots are turned into previews on a thread of
//! their own, seldom enough to cost little; a preview that fails, or a page that is closed, is no concern of the training.
//!
//! Previews are lossless: 200,000 splats with 16.7 million texels take 0.75 s to write and 0.4 s to read, where files rounded by
//! fixed steps take 4.3 s and 3.8 s.

use super::curve::Curve;
use super::sources::load_scene;
use super::training_values::View;
use super::view::{announce, start};
use super::view_photos::offer_photos;
use super::view_scene::{in_memory, name_of, quick, served};
use crate::viewer::{AssetBytes, Server, Shown};
use litetex_exporters::html::{SessionAsset, SessionTraining, TrainingState};
use litetex_exporters::{AssetCamera, Provenance};
use litetex_gs::bake::{asset_cameras, bake, set_up};
use litetex_gs::camera::up::Up;
use litetex_gs::capture::Capture;
use litetex_gs::console::{Interrupt, Log};
use litetex_gs::model::Model;
use litetex_gs::run::{PREVIEW, RunConfig, RunFolder};
use litetex_gs::train::{NO_SNAPSHOT, StopReason, TrainEvent};
use litetex_gs::{Error, Report, Result, atomic_file};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between previews: at least this, and this many times what the last one took, which bounds what they cost to 2.5 % of
/// the training time. While nobody looks, ten times that.
const INTERVAL_MIN: Duration = Duration::from_secs(3);
const REST: u32 = 40;
const UNWATCHED: u32 = 10;

/// Somebody looks if the page, which asks every second or two, has asked within this time.
const WATCHED_WITHIN: Duration = Duration::from_secs(10);

/// Time between two looks for Ctrl-C.
const NAP: Duration = Duration::from_millis(50);

/// The page of a training, served until it is dropped.
pub struct LiveView {
    shown: Arc<Shown>,
    server: Server,
    no_open: bool,
}

impl LiveView {
    /// Starts the server; nothing is announced yet.
    ///
    /// # Errors
    /// As [`start`].
    pub fn start(how: View) -> Result<Self> {
        let port = if let View::Port(port) = how { Some(port) } else { None };
        let shown = Arc::new(Shown::default());
        Ok(Self { server: start(port, "--view", &shown)?, shown, no_open: how != View::Open })
    }

    /// Announces the page and returns what fills it during the training.
    ///
    /// # Errors
    /// As [`announce`]; [`Error::Device`] if the system gives no thread.
    pub fn follow(
        &self,
        folder: &RunFolder,
        capture: &Arc<Capture>,
        config: &RunConfig,
        log: &Log,
    ) -> Result<Preview> {
        announce(&self.server, self.no_open, log)?;
        let title = config.data.as_deref().map(name_of).unwrap_or_default();
        self.shown.set_title(&title);
        offer_photos(Some(Arc::clone(capture)), &self.shown);
        let scene = PreviewScene {
            title,
            cameras: asset_cameras(&**capture),
            background: config.train.background,
            up: capture.up,
            file: folder.root().join(PREVIEW),
        };
        Preview::start(Arc::clone(&self.shown), scene, config.train.last_step())
    }

    /// Shows the finished model of a run in place of its last preview, and serves it until Ctrl-C.
    ///
    /// # Errors
    /// What reading the run reports.
    pub fn stay(self, run: &Path, log: &Log) -> Result<()> {
        let interrupt = Interrupt::listen(log, "closing the viewer")?;
        let (scene, _) = load_scene(run, log)?;
        let (asset, bytes) = served(&scene)?;
        self.shown.set_asset(&scene.asset.provenance.title, asset, bytes);
        log.info("training finished; the viewer stays open, Ctrl-C ends it");
        while !interrupt.is_requested() {
            std::thread::sleep(NAP);
        }
        Ok(())
    }
}

/// What previews need besides the model.
struct PreviewScene {
    title: String,
    cameras: Vec<AssetCamera>,
    background: [f32; 3],
    up: Up,
    file: PathBuf,
}

impl PreviewScene {
    /// Writes the preview of a model, and returns it for the page.
    fn write(&self, step: u32, model: &Model) -> Result<(SessionAsset, AssetBytes)> {
        let provenance = Provenance {
            title: self.title.clone(),
            source: self.title.clone(),
            training: [("steps".to_owned(), step.to_string())].into(),
            ..Provenance::default()
        };
        let mut asset =
            bake(model, self.cameras.clone(), self.background, provenance, &mut Report::default());
        set_up(&mut asset, &self.up);
        let bytes = quick(&asset).map_err(|e| Error::from(e.at(&self.file)))?;
        atomic_file::write(&self.file, &bytes)?;
        Ok(in_memory(bytes, format!("step {step}")))
    }
}

/// A model to make a preview of, and the time that reading it took.
struct Snapshot {
    step: u32,
    model: Model,
    read_secs: f64,
}

/// The previews of one training; the file of the last one is removed when this is dropped.
pub struct Preview {
    shown: Arc<Shown>,
    file: PathBuf,
    /// `None` once it has ended.
    jobs: Option<Sender<Snapshot>>,
    /// What each preview took.
    done: Receiver<Result<Duration>>,
    worker: Option<JoinHandle<()>>,
    pace: Pace,
    curve: Curve,
    training: SessionTraining,
}

impl Preview {
    fn start(shown: Arc<Shown>, scene: PreviewScene, steps: u32) -> Result<Self> {
        let refused = |what: String| Error::Device(format!("no thread for previews: {what}"));
        // A pool of its own: previews take one core, and work of the training never waits behind them.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|e| refused(e.to_string()))?;
        let (jobs, to_do) = mpsc::channel::<Snapshot>();
        let (report, done) = mpsc::channel();
        let (for_page, file) = (Arc::clone(&shown), scene.file.clone());
        let work = move || {
            for Snapshot { step, model, read_secs } in to_do {
                let began = Instant::now();
                let outcome = pool.install(|| scene.write(step, &model)).map(|(asset, bytes)| {
                    for_page.set_asset(&scene.title, asset, bytes);
                    began.elapsed() + Duration::from_secs_f64(read_secs)
                });
                if report.send(outcome).is_err() {
                    return;
                }
            }
        };
        let worker = std::thread::Builder::new().name("preview".into()).spawn(work);
        let worker = Some(worker.map_err(|e| refused(e.to_string()))?);
        let training = SessionTraining {
            step: 0,
            steps,
            eta_secs: None,
            splats: 0,
            texels: 0,
            curve: Vec::new(),
            curve_of: String::new(),
            state: TrainingState::Running,
            revision: 0,
        };
        let (pace, curve) = (Pace::default(), Curve::default());
        Ok(Self { shown, file, jobs: Some(jobs), done, worker, pace, curve, training })
    }

    /// Takes in an event and tells whether a snapshot is wanted.
    pub fn handle(&mut self, event: &TrainEvent<'_>, log: &Log) -> bool {
        match event {
            &TrainEvent::Step { step, loss, size, remaining_secs, .. } => {
                self.curve.add_loss(step, loss.total);
                let training = &mut self.training;
                (training.step, training.eta_secs) = (step, Some(remaining_secs));
                (training.splats, training.texels) = (size.splats as u64, size.texels as u64);
                self.take_outcomes(log);
                if self.pace.tells_page() {
                    self.tell();
                }
                return self.jobs.is_some() && self.pace.is_due(self.shown.is_watched(WATCHED_WITHIN));
            }
            // Asking again would fail again.
            TrainEvent::Warning(warning) if warning.code == NO_SNAPSHOT => self.jobs = None,
            TrainEvent::Evaluated { step, evaluation, .. } => self.curve.add_psnr(*step, evaluation.psnr),
            TrainEvent::Finished { reason } => {
                self.training.state = match reason {
                    StopReason::Steps => TrainingState::Finished,
                    StopReason::Consumer => TrainingState::Stopped,
                };
                self.training.eta_secs = None;
                self.tell();
            }
            _ => {}
        }
        false
    }

    /// Has a preview made of a snapshot.
    pub fn take(&mut self, step: u32, model: Model, read_secs: f64) {
        if let Some(jobs) = &self.jobs {
            self.pace.begin();
            // The worker ends only after it has reported an error.
            let _ = jobs.send(Snapshot { step, model, read_secs });
        }
    }

    fn take_outcomes(&mut self, log: &Log) {
        match self.done.try_recv() {
            Ok(Ok(took)) => {
                log.detail(&format!("a preview took {:.0} ms", 1e3 * took.as_secs_f64()));
                self.pace.end(took);
            }
            Ok(Err(error)) => {
                log.warn("no-preview", &format!("the page shows no newer previews: {error}"), 1);
                self.jobs = None;
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => self.jobs = None,
        }
    }

    fn tell(&mut self) {
        let (curve_of, curve) = self.curve.shown();
        let training = SessionTraining { curve, curve_of: curve_of.to_owned(), ..self.training.clone() };
        self.shown.set_training(training);
    }
}

impl Drop for Preview {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(worker) = self.worker.take() {
            let _ = worker.join();
        }
        // The checkpoint has the same model, or a later one.
        let _ = std::fs::remove_file(&self.file);
        if self.training.state == TrainingState::Running {
            // The training failed.
            self.training.state = TrainingState::Stopped;
            self.tell();
        }
    }
}

/// When the next preview, and the next figures, are due.
#[derive(Default)]
struct Pace {
    is_busy: bool,
    /// When the last preview began; `None` before the first.
    began: Option<Instant>,
    /// What it took.
    took: Duration,
    told: Option<Instant>,
}

impl Pace {
    /// Time between the figures that the page gets.
    const TELL_INTERVAL: Duration = Duration::from_millis(500);

    fn is_due(&self, is_watched: bool) -> bool {
        let pause = INTERVAL_MIN.max(REST * self.took);
        let pause = if is_watched { pause } else { UNWATCHED * pause };
        !self.is_busy && self.began.is_none_or(|began| began.elapsed() >= pause)
    }

    fn begin(&mut self) {
        self.is_busy = true;
        self.began = Some(Instant::now());
    }

    fn end(&mut self, took: Duration) {
        self.is_busy = false;
        self.took = took;
    }

    /// Whether the page gets figures now.
    fn tells_page(&mut self) -> bool {
        let is_due = self.told.is_none_or(|told| told.elapsed() >= Self::TELL_INTERVAL);
        if is_due {
            self.told = Some(Instant::now());
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn previews_rest_forty_times_as_long_as_they_take() {
        let ago = |secs| Instant::now().checked_sub(Duration::from_secs(secs));
        let pace = |began, took| Pace { began, took: Duration::from_millis(took), ..Pace::default() };
        assert!(Pace::default().is_due(false), "the first one is due at once");
        for (began, took, watched, unwatched) in [
            (2, 0, false, false),
            (4, 0, true, false),
            (31, 0, true, true),
            (7, 200, false, false),
            (9, 200, true, false),
        ] {
            let pace = pace(ago(began), took);
            assert_eq!([pace.is_due(true), pace.is_due(false)], [watched, unwatched], "{began} s, {took} ms");
        }
        let mut busy = pace(ago(100), 0);
        busy.is_busy = true;
        assert!(!busy.is_due(true), "one at a time");
        busy.end(Duration::ZERO);
        assert!(busy.is_due(true));
    }
}
