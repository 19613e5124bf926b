//! Turns the events of a training into the files of its run folder, and notes what a warning should tell.

use super::config::{RunConfig, SaveImages};
use super::evaluations::StagedFolder;
use super::folder::RunFolder;
use super::outlying::ViewLosses;
use super::summary::INTERRUPTED;
use super::view_files::{write_per_view, write_view};
use crate::backend::{RenderedImage, StepReport};
use crate::eval::Evaluation;
use crate::text::counted;
use crate::train::checkpoint;
use crate::train::{Remaining, StopReason, TrainConfig, TrainEvent, TrainHistory, TrainState};
use crate::verify::{CAMERAS_KEY, CaptureIdentity, IDENTITY_KEY, cameras_json, store_metric, store_up};
use crate::views::ViewSource;
use crate::{Error, Report, Result, Warning, atomic_file, input_file};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Steps between two lines of `metrics.jsonl`; the first and the last step are always there.
const METRICS_EVERY: u32 = 10;

/// Outlying views that a warning names.
const OUTLYING_SHOWN: usize = 5;

/// A larger share of test pixels that nothing covers gets a warning.
const UNCOVERED_MAX: f64 = 0.01;

/// Steps before which even well-seen surfaces may be translucent: splats start at opacity 0.1.
pub(super) const UNCOVERED_MIN_STEPS: u32 = 200;

/// Writes the files of one training.
pub struct Recorder<'a> {
    pub(super) folder: &'a RunFolder,
    views: &'a dyn ViewSource,
    pub(super) config: &'a RunConfig,
    metrics: File,
    /// The strings of every checkpoint.
    strings: BTreeMap<String, String>,
    /// Settings of the training, with the changes of its length so far.
    pub(super) train: TrainConfig,
    pub(super) total_wall_secs: Box<dyn Fn() -> f64 + 'a>,
    /// The evaluation in progress.
    staged: Option<StagedFolder>,
    /// Step of the last evaluation that has images.
    last_with_images: Option<u32>,
    /// Number of gradient entries, over all steps, that were not finite.
    non_finite_gradients: u64,
    losses: ViewLosses,
    /// Step of the last evaluation.
    evaluated_step: u32,
    /// The last evaluation.
    pub(super) evaluation: Option<Evaluation>,
    /// The last checkpoint.
    checkpoint: Option<PathBuf>,
    /// Steps of the checkpoints that the next one replaces.
    interim: Vec<u32>,
    /// All warnings.
    pub(super) report: Report,
    /// Those that [`Recorder::take_warnings`] has not returned.
    unsaid: Vec<Warning>,
}

impl<'a> Recorder<'a> {
    /// A recorder that continues after `done` steps: lines of later steps are dropped from `metrics.jsonl`, since these
    /// steps will be repeated. `total_wall_secs` is the time that the run has taken so far.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn new(
        folder: &'a RunFolder,
        views: &'a dyn ViewSource,
        config: &'a RunConfig,
        done: u32,
        total_wall_secs: impl Fn() -> f64 + 'a,
    ) -> Result<Self> {
        let toml = config.to_toml()?;
        atomic_file::write(&folder.config(), toml.as_bytes())?;
        let (metrics, interim) = open_metrics(&folder.metrics(), done)?;
        Ok(Self {
            folder,
            views,
            config,
            metrics,
            strings: BTreeMap::from([("config".to_owned(), checkpoint_settings(config)?)]),
            train: config.train.clone(),
            total_wall_secs: Box::new(total_wall_secs),
            staged: None,
            last_with_images: None,
            non_finite_gradients: 0,
            losses: ViewLosses::default(),
            evaluated_step: 0,
            evaluation: None,
            checkpoint: None,
            interim,
            report: Report::default(),
            unsaid: Vec::new(),
        })
    }

    /// The last checkpoint.
    pub fn checkpoint(&self) -> Option<&Path> {
        self.checkpoint.as_deref()
    }

    /// Warnings that were not returned before, for the user.
    pub fn take_warnings(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.unsaid)
    }

    /// Records one event.
    ///
    /// # Errors
    /// What writing files reports.
    pub fn record(&mut self, event: &TrainEvent<'_>) -> Result<()> {
        match event {
            TrainEvent::Started { device, step, steps, train_views, test_views } => self
                .metric(json!({ "event": "started", "step": step, "steps": steps, "device": device,
                    "train_views": train_views, "test_views": test_views })),
            TrainEvent::Step { .. } => self.step(event),
            TrainEvent::DensityControl { step, counts, size, render_scale, texture_cap, wall_secs } => self
                .metric(json!({ "event": "density-control", "step": step, "counts": counts,
                "splats": size.splats, "texels": size.texels, "params": size.params,
                "render_scale": render_scale,
                "texture_cap": texture_cap, "wall_secs": wall_secs })),
            &TrainEvent::Planned { step, last_step, remaining } => self.planned(step, last_step, &remaining),
            TrainEvent::Pruned(pruned) => {
                self.metric(json!({ "event": "pruned", "step": pruned.step, "pruned": pruned }))
            }
            TrainEvent::EvalView { step, view, image } => self.eval_view(*step, *view, image),
            TrainEvent::Evaluated { step, evaluation, point, last } => {
                self.evaluated_step = *step;
                self.metric(json!({ "event": "evaluated", "step": step, "last": last, "point": point,
                    "ssim_3dgs": evaluation.ssim_3dgs, "ssim_valid": evaluation.ssim_valid,
                    "flip": evaluation.flip, "psnr_corrected": evaluation.psnr_corrected,
                    "uncovered": evaluation.uncovered }))?;
                self.publish_eval(*step, evaluation)
            }
            TrainEvent::Checkpoint { state, is_interim } => self.save(state, *is_interim),
            TrainEvent::Snapshot { .. } => Ok(()),
            TrainEvent::Warning(warning) => self.warn(warning.clone()),
            TrainEvent::Finished { reason } => {
                self.warn_of_gradients()?;
                self.warn_of_views()?;
                let uncovered = self.evaluation.as_ref().and_then(|evaluation| evaluation.uncovered);
                if let Some(share) = uncovered.filter(|_| self.evaluated_step >= UNCOVERED_MIN_STEPS) {
                    self.warn_of_uncovered_pixels(
                        "test",
                        share,
                        "what no training view shows needs more photos; other gaps may close with more steps",
                    )?;
                }
                self.metric(json!({ "event": "finished", "reason": reason_name(*reason) }))
            }
        }
    }

    /// Writes a decision on the length of the run into its settings, so that it can be repeated without a clock.
    fn planned(&mut self, step: u32, last_step: u32, remaining: &Remaining) -> Result<()> {
        self.train.plan.push([step, last_step]);
        let config = RunConfig { train: self.train.clone(), ..self.config.clone() };
        let toml = config.to_toml()?;
        atomic_file::write(&self.folder.config(), toml.as_bytes())?;
        self.strings.insert("config".to_owned(), checkpoint_settings(&config)?);
        self.metric(
            json!({ "event": "planned", "step": step, "steps": last_step, "eta_secs": remaining.secs(),
            "steps_secs": remaining.steps_secs, "density_control_secs": remaining.density_secs,
            "pruning_secs": remaining.pruning_secs, "rounding_secs": remaining.rounding_secs,
            "end_secs": remaining.end_secs,
            "total_wall_secs": (self.total_wall_secs)() }),
        )
    }

    fn step(&mut self, event: &TrainEvent<'_>) -> Result<()> {
        let &TrainEvent::Step { step, view, loss, report, size, train_wall_secs, train_cpu_secs, .. } = event
        else {
            return Ok(());
        };
        self.losses.record(view, loss.l1 + loss.dssim);
        self.non_finite_gradients += report.non_finite_gradients;
        if step == 1 || step.is_multiple_of(METRICS_EVERY) || step == self.train.last_step() {
            self.metric(json!({ "event": "step", "step": step, "view": self.views.name(view),
                "loss": loss, "splats": size.splats, "texels": size.texels, "params": size.params,
                "train_wall_secs": train_wall_secs, "train_cpu_secs": train_cpu_secs,
                "counters": counters(report), "pass_secs": passes(report),
                "non_finite_gradients": report.non_finite_gradients }))?;
        }
        Ok(())
    }

    /// Warns once a run of the gradients that the steps have counted.
    fn warn_of_gradients(&mut self) -> Result<()> {
        let count = self.non_finite_gradients;
        if count == 0 {
            return Ok(());
        }
        let message = format!("{count} gradients were NaN or infinite and were treated as zero");
        self.warn(Warning { code: "gradients-not-finite".to_owned(), message, count: count as usize })
    }

    /// Names of training views whose loss stands out at the end, worst first.
    pub(super) fn outlying_views(&self) -> Vec<String> {
        self.losses.outlying().into_iter().map(|view| self.views.name(view).to_owned()).collect()
    }

    fn warn_of_views(&mut self) -> Result<()> {
        let names = self.outlying_views();
        if names.is_empty() {
            return Ok(());
        }
        let shown = names[..names.len().min(OUTLYING_SHOWN)].join(", ");
        let more = match names.len().saturating_sub(OUTLYING_SHOWN) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let message = format!(
            "{} that fit much worse than the others: {shown}{more}; look for wrong poses, other exposures (--set \
             exposure=affine, compared by psnr_corrected) or moving things there",
            counted(names.len(), "training view")
        );
        self.warn(Warning { code: "outlying-views".to_owned(), message, count: names.len() })
    }

    /// Warns of uncovered pixels; `advice` says what may help.
    pub(super) fn warn_of_uncovered_pixels(&mut self, views: &str, share: f64, advice: &str) -> Result<()> {
        if share <= UNCOVERED_MAX {
            return Ok(());
        }
        let message = format!(
            "{:.1} % of the pixels of the {views} views are uncovered: their alpha is below 0.5; {advice}",
            100.0 * share
        );
        self.warn(Warning { code: "uncovered-pixels".to_owned(), message, count: 1 })
    }

    pub(super) fn warn(&mut self, warning: Warning) -> Result<()> {
        self.metric(json!({ "event": "warning", "warning": warning }))?;
        self.report.warn(&warning.code, warning.count, warning.message.clone());
        self.unsaid.push(warning);
        Ok(())
    }

    fn eval_view(&mut self, step: u32, view: usize, image: &RenderedImage) -> Result<()> {
        if self.staged.is_none() {
            self.staged = Some(self.folder.stage_eval(step)?);
        }
        if let Some(staged) = &self.staged
            && self.config.save_images != SaveImages::None
        {
            write_view(staged.path(), self.views, view, image)?;
        }
        Ok(())
    }

    fn publish_eval(&mut self, step: u32, evaluation: &Evaluation) -> Result<()> {
        let staged = match self.staged.take() {
            Some(staged) => staged,
            None => self.folder.stage_eval(step)?,
        };
        write_per_view(staged.path(), evaluation)?;
        staged.publish()?;
        if self.config.save_images == SaveImages::Last
            && let Some(before) = self.last_with_images.replace(step)
            && before != step
        {
            self.folder.drop_images(before)?;
        }
        self.evaluation = Some(evaluation.clone());
        Ok(())
    }

    fn save(&mut self, state: &TrainState, is_interim: bool) -> Result<()> {
        let path = self.folder.checkpoint(state.step)?;
        let total_wall_secs = (self.total_wall_secs)();
        let history = TrainHistory { total_wall_secs, ..state.history.clone() };
        let identity = CaptureIdentity::new(self.views, state.model.capture_from_local);
        self.strings.insert(IDENTITY_KEY.to_owned(), identity.to_json()?);
        self.strings.insert(CAMERAS_KEY.to_owned(), cameras_json(self.views)?);
        store_up(self.views, &mut self.strings)?;
        store_metric(self.views, &mut self.strings);
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.metric(
            json!({ "event": "checkpoint", "step": state.step, "file": name, "is_interim": is_interim }),
        )?;
        // The line comes first: a run that is resumed after a kill must know of every interim checkpoint there is.
        checkpoint::save(&path, state, &history, &self.strings)?;
        self.checkpoint = Some(path);
        self.interim.retain(|&step| step != state.step);
        // One that cannot be removed now, as while another program reads it, may be with the next.
        self.interim.retain(|&step| self.folder.remove_checkpoint(step).is_err());
        self.interim.extend(is_interim.then_some(state.step));
        Ok(())
    }

    fn metric(&mut self, line: Value) -> Result<()> {
        // One write per line, so that an interruption cannot leave half a line.
        self.metrics
            .write_all(format!("{line}\n").as_bytes())
            .map_err(|e| Error::io(self.folder.metrics(), e))
    }
}

/// The settings in a checkpoint: without the time, which the plan has replaced, so that a run that repeats the plan has the
/// same checkpoint. The run's own `config.toml` keeps it.
fn checkpoint_settings(config: &RunConfig) -> Result<String> {
    RunConfig { time_secs: None, most_steps: None, ..config.clone() }.to_toml()
}

/// Name of a stop reason in `metrics.jsonl` and `summary.json`.
pub(super) fn reason_name(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Steps => "steps",
        StopReason::Consumer => INTERRUPTED,
    }
}

/// Counters of a step; null for those that the device does not count.
fn counters(report: &StepReport) -> Value {
    let c = &report.counters;
    let mut counters = json!(c);
    if (c.evaluated_pairs, c.inside_pairs, c.blended_pairs) == (0, 0, 0) {
        for name in ["evaluated_pairs", "inside_pairs", "blended_pairs"] {
            counters[name] = Value::Null;
        }
    }
    counters
}

/// Seconds of a step by pass.
fn passes(report: &StepReport) -> Value {
    let secs = report.stages.iter().map(|(name, time)| ((*name).to_owned(), json!(time.as_secs_f64())));
    Value::Object(secs.collect())
}

/// The lines so far, if there are any. After a power cut some may be no text; they are dropped with others that are not
/// understood.
fn read_metrics(path: &Path) -> Result<String> {
    match input_file::read(path, u64::MAX) {
        Ok(bytes) => Ok(String::from_utf8_lossy(&bytes).into_owned()),
        Err(Error::Io { cause, .. }) if cause.kind() == ErrorKind::NotFound => Ok(String::new()),
        Err(e) => Err(e),
    }
}

/// Opens `metrics.jsonl` for appending, without the lines of steps after `done`; with the steps of interim checkpoints that
/// it tells of.
fn open_metrics(path: &Path, done: u32) -> Result<(File, Vec<u32>)> {
    let kept = if done > 0 { read_metrics(path)? } else { String::new() };
    let mut interim: Vec<u32> = Vec::new();
    let is_earlier = |line: &&str| {
        let value: Value = serde_json::from_str(line).unwrap_or_default();
        if value["event"] == "checkpoint"
            && let Some(step) = value["step"].as_u64().filter(|&step| step <= u64::from(done))
        {
            interim.retain(|&other| u64::from(other) != step);
            interim.extend((value["is_interim"] == true).then_some(step as u32));
        }
        match value["event"].as_str() {
            Some("started" | "warning") => true,
            Some("finished") | None => false,
            _ => value["step"].as_u64().is_some_and(|step| step <= u64::from(done)),
        }
    };
    let kept: String = kept.lines().filter(is_earlier).flat_map(|line| [line, "\n"]).collect();
    atomic_file::write(path, kept.as_bytes())?;
    let file = File::options().append(true).open(path).map_err(|e| Error::io(path, e))?;
    Ok((file, interim))
}
