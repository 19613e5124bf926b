//! Follows the folder of a run: its newest scene, its progress, and whether its training still lives.

use super::metrics_tail::MetricsTail;
use super::sources::load_scene;
use super::stamp::Stamp;
use super::view_photos::{no_photos, not_shown, offer_photos};
use super::view_scene::{LTGS, described, name_of, served};
use crate::viewer::{AssetBytes, Shown};
use litetex_exporters::html::{SessionAsset, TrainingState};
use litetex_gs::capture::Capture;
use litetex_gs::console::Log;
use litetex_gs::run::{PREVIEW, RunConfig, RunLock, find_checkpoint};
use litetex_gs::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A run that is shown.
pub struct RunWatch {
    root: PathBuf,
    title: String,
    shown: Arc<Shown>,
    metrics: MetricsTail,
    /// What is shown, or could not be.
    current: Option<Stamp>,
}

impl RunWatch {
    /// Shows a run, and its photos if its capture, or the one named, is there.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] for a run without a scene whose training has ended; what reading its settings, its scene or the
    /// named capture reports.
    pub fn start(root: &Path, named: Option<&Path>, shown: Arc<Shown>, log: &Log) -> Result<Self> {
        let config = RunConfig::read(&root.join("config.toml"))?;
        let metrics = MetricsTail::new(root.join("metrics.jsonl"), config.train.last_step());
        let of_capture = config.data.as_deref().map(name_of).unwrap_or_default();
        let title = if of_capture.is_empty() { name_of(root) } else { of_capture };
        shown.set_title(&title);
        let mut watch = Self { root: root.to_owned(), title, shown, metrics, current: None };
        let is_running = RunLock::is_taken(root);
        if watch.newest(is_running).is_none() && !is_running {
            // The error says what was expected.
            find_checkpoint(root)?;
        }
        watch.show_scene(is_running, log)?;
        watch.show_training(is_running);
        match open_capture(&config, named) {
            Err(error) if named.is_some() => return Err(error),
            Err(error) => no_photos(&error, log),
            Ok(capture) => offer_photos(Some(Arc::new(capture)), &watch.shown),
        }
        Ok(watch)
    }

    /// Looks for changes. What cannot be read, as when it has just been replaced, is reported and tried again once it changes.
    pub fn look(&mut self, log: &Log) {
        let is_running = RunLock::is_taken(&self.root);
        if let Err(error) = self.show_scene(is_running, log) {
            not_shown(&error, log);
        }
        self.show_training(is_running);
    }

    /// The newest scene. While training goes on, that is the preview, if there is one: checkpoints take longer to read.
    fn newest(&self, is_running: bool) -> Option<Stamp> {
        // What a run folder from someone else links to is not to be served.
        let preview = Stamp::of_own(self.root.join(PREVIEW));
        let checkpoint = find_checkpoint(&self.root).ok().and_then(Stamp::of);
        match (preview, checkpoint) {
            (Some(preview), Some(checkpoint)) if !is_running && checkpoint.changed >= preview.changed => {
                Some(checkpoint)
            }
            (preview, checkpoint) => preview.or(checkpoint),
        }
    }

    fn show_scene(&mut self, is_running: bool, log: &Log) -> Result<()> {
        let Some(newest) = self.newest(is_running).filter(|newest| self.current.as_ref() != Some(newest))
        else {
            return Ok(());
        };
        self.current = Some(newest.clone());
        let (asset, bytes) = scene_of(&newest, log)?;
        self.shown.set_asset(&self.title, asset, bytes);
        Ok(())
    }

    fn show_training(&mut self, is_running: bool) {
        let Some(training) = self.metrics.read() else { return };
        let state = match (is_running, training.state) {
            (true, _) => TrainingState::Running,
            (false, TrainingState::Running) => TrainingState::Stopped,
            (false, ended) => ended,
        };
        let eta_secs = training.eta_secs.filter(|_| is_running);
        self.shown.set_training(litetex_exporters::html::SessionTraining { state, eta_secs, ..training });
    }
}

fn scene_of(newest: &Stamp, log: &Log) -> Result<(SessionAsset, AssetBytes)> {
    if newest.path.extension().is_some_and(|e| e == LTGS) {
        let asset = described(LTGS, name_of(&newest.path), newest.bytes);
        return Ok((asset, AssetBytes::File(newest.path.clone())));
    }
    served(&load_scene(&newest.path, log)?.0)
}

fn open_capture(config: &RunConfig, named: Option<&Path>) -> Result<Capture, Error> {
    let folder = match named {
        Some(folder) => folder,
        None => config.data()?,
    };
    Capture::load(folder, &config.capture)
}
