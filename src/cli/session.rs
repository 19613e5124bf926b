//! The consumer of the trainer's events on the command line: it fills the run folder, feeds the
//! progress display and answers whether to go on. It computes nothing but file names.

use super::config_file::RunConfig;
use super::identity::{self, Identity};
use super::interrupt::Interrupt;
use super::log::Log;
use super::progress::{Progress, StepFigures};
use super::run_folder::{RunFolder, StagedFolder};
use super::train_args::SaveImages;
use litetex_gs::backend::{RenderedImage, StepReport};
use litetex_gs::eval::{Evaluation, error_map, quantised};
use litetex_gs::image::{Channels, write_png};
use litetex_gs::train::checkpoint;
use litetex_gs::train::{Control, StopReason, TrainEvent, TrainHistory, TrainState};
use litetex_gs::views::ViewSource;
use litetex_gs::{Error, Report, Result, Warning, atomic_file};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Steps between two lines of `metrics.jsonl`; the first and the last step are always there.
pub const METRICS_EVERY: u32 = 10;

/// Files and display of one training.
pub struct Session<'a> {
    folder: &'a RunFolder,
    views: &'a dyn ViewSource,
    config: &'a RunConfig,
    log: &'a Log,
    interrupt: Interrupt,
    progress: Progress<'a>,
    metrics: File,
    /// Strings that go into every checkpoint.
    strings: BTreeMap<String, String>,
    total_wall_secs: Box<dyn Fn() -> f64 + 'a>,
    staged: Option<StagedFolder>,
    imaged: Option<u32>,
    /// Gradient entries that were not finite, over all steps.
    non_finite_gradients: u64,
    /// The last evaluation.
    pub evaluation: Option<Evaluation>,
    /// The last checkpoint.
    pub checkpoint: Option<PathBuf>,
    /// What was warned of.
    pub report: Report,
}

impl<'a> Session<'a> {
    /// A session that continues after `done` steps: later lines of `metrics.jsonl` are dropped, for these
    /// steps will be done again.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn new(
        folder: &'a RunFolder,
        views: &'a dyn ViewSource,
        config: &'a RunConfig,
        log: &'a Log,
        interrupt: Interrupt,
        done: u32,
        total_wall_secs: impl Fn() -> f64 + 'a,
    ) -> Result<Self> {
        let toml = config.to_toml()?;
        atomic_file::write(&folder.config(), toml.as_bytes())?;
        Ok(Self {
            folder,
            views,
            config,
            log,
            interrupt,
            progress: Progress::new(log, done, config.train.steps, config.train.max_time_secs),
            metrics: open_metrics(&folder.metrics(), done)?,
            strings: BTreeMap::from([("config".to_owned(), toml)]),
            total_wall_secs: Box::new(total_wall_secs),
            staged: None,
            imaged: None,
            non_finite_gradients: 0,
            evaluation: None,
            checkpoint: None,
            report: Report::default(),
        })
    }

    /// Takes in one event.
    ///
    /// # Errors
    /// What writing reports.
    pub fn handle(&mut self, event: TrainEvent<'_>) -> Result<Control> {
        match event {
            TrainEvent::Started { device, step, steps, train_views, test_views } => {
                self.log.info(&format!(
                    "{train_views} views to train on, {test_views} held out, on {}: {}",
                    device.name, device.description
                ));
                self.metric(json!({ "event": "started", "step": step, "steps": steps, "device": device,
                    "train_views": train_views, "test_views": test_views }))?;
            }
            TrainEvent::Step {
                step,
                view,
                loss,
                report,
                num_splats,
                num_texels,
                train_wall_secs,
                train_cpu_secs,
                remaining_secs,
            } => {
                self.non_finite_gradients += report.non_finite_gradients;
                self.progress.step(StepFigures {
                    step,
                    loss: loss.total,
                    primitives: num_splats,
                    texels: num_texels,
                    train_wall_secs,
                    remaining_secs,
                });
                if step == 1 || step.is_multiple_of(METRICS_EVERY) || step == self.config.train.steps {
                    self.metric(json!({ "event": "step", "step": step, "view": self.views.name(view),
                        "loss": loss, "primitives": num_splats, "texels": num_texels,
                        "train_wall_secs": train_wall_secs, "train_cpu_secs": train_cpu_secs,
                        "counters": counters(report), "stages_secs": stages(report),
                        "non_finite_gradients": report.non_finite_gradients }))?;
                }
            }
            TrainEvent::DensityControl {
                step,
                counts,
                num_splats,
                num_texels,
                render_scale,
                texture_cap,
                wall_secs,
            } => self.metric(json!({ "event": "density-control", "step": step, "counts": counts,
                "num_splats": num_splats, "num_texels": num_texels, "render_scale": render_scale,
                "texture_cap": texture_cap, "wall_secs": wall_secs }))?,
            TrainEvent::EvalView { step, view, image } => self.eval_view(step, view, image)?,
            TrainEvent::Evaluated { step, evaluation, point, last } => {
                self.progress.evaluated(step, evaluation.psnr, evaluation.grad_psnr);
                self.metric(json!({ "event": "evaluated", "step": step, "last": last, "point": point,
                    "ssim_3dgs": evaluation.ssim_3dgs, "ssim_valid": evaluation.ssim_valid,
                    "flip": evaluation.flip }))?;
                self.publish_eval(step, evaluation)?;
            }
            TrainEvent::Checkpoint { state } => self.save(state)?,
            TrainEvent::Warning(warning) => {
                self.log.warn(&warning.code, &warning.message, warning.count);
                self.metric(json!({ "event": "warning", "warning": warning }))?;
                self.report.warn(&warning.code, warning.count, warning.message);
            }
            TrainEvent::Finished { reason } => {
                self.progress.finish();
                self.tell_of_gradients()?;
                self.metric(json!({ "event": "finished", "reason": reason_name(reason) }))?;
            }
        }
        Ok(if self.interrupt.is_requested() { Control::Stop } else { Control::Continue })
    }

    /// After a failure: what was saved, and how to go on from there.
    pub fn say_how_to_continue(&self) {
        if let Some(saved) = &self.checkpoint {
            let message = format!(
                "the run failed, its work is saved in {}; mend the cause and continue with: litetex train --resume {}",
                saved.display(),
                self.folder.root().display()
            );
            self.log.warn("saved-before-failure", &message, 1);
        }
    }

    /// Steps count them one by one; a run tells of them once.
    fn tell_of_gradients(&mut self) -> Result<()> {
        let count = self.non_finite_gradients;
        if count == 0 {
            return Ok(());
        }
        let message = format!("{count} gradients were NaN or infinite and counted as zero");
        self.handle(TrainEvent::Warning(Warning {
            code: "gradients-not-finite".to_owned(),
            message,
            count: count as usize,
        }))?;
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
        write_per_view(&staged.path().join("per_view.csv"), evaluation)?;
        staged.publish()?;
        if self.config.save_images == SaveImages::Last
            && let Some(before) = self.imaged.replace(step)
            && before != step
        {
            self.folder.drop_images(before)?;
        }
        self.evaluation = Some(evaluation.clone());
        Ok(())
    }

    fn save(&mut self, state: &TrainState) -> Result<()> {
        let path = self.folder.checkpoint(state.step)?;
        let total_wall_secs = (self.total_wall_secs)();
        let history = TrainHistory { total_wall_secs, ..state.history.clone() };
        let identity = Identity::new(self.views, state.model.capture_from_local);
        self.strings.insert(identity::KEY.to_owned(), identity.to_json()?);
        self.strings.insert(identity::CAMERAS.to_owned(), identity::cameras_json(self.views)?);
        checkpoint::save(&path, state, &history, &self.strings)?;
        self.log.detail(&format!("saved {}", path.display()));
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.metric(json!({ "event": "checkpoint", "step": state.step, "file": name }))?;
        self.checkpoint = Some(path);
        Ok(())
    }

    fn metric(&mut self, line: Value) -> Result<()> {
        // One write per line: an interruption cannot leave half of one.
        self.metrics
            .write_all(format!("{line}\n").as_bytes())
            .map_err(|e| Error::io(self.folder.metrics(), e))
    }
}

/// Name of a reason in files.
pub fn reason_name(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Steps => "steps",
        StopReason::Time => "time",
        StopReason::Consumer => "interrupted",
    }
}

/// Counters of a step; null for those that the device did not count.
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

fn stages(report: &StepReport) -> Value {
    let secs = report.stages.iter().map(|(name, time)| ((*name).to_owned(), json!(time.as_secs_f64())));
    Value::Object(secs.collect())
}

fn open_metrics(path: &Path, done: u32) -> Result<File> {
    let kept = match fs::read_to_string(path) {
        Ok(text) if done > 0 => text,
        _ => String::new(),
    };
    let is_earlier = |line: &&str| {
        let value: Value = serde_json::from_str(line).unwrap_or_default();
        match value["event"].as_str() {
            Some("started" | "warning") => true,
            Some("finished") | None => false,
            _ => value["step"].as_u64().is_some_and(|step| step <= u64::from(done)),
        }
    };
    let kept: String = kept.lines().filter(is_earlier).flat_map(|line| [line, "\n"]).collect();
    atomic_file::write(path, kept.as_bytes())?;
    File::options().append(true).open(path).map_err(|e| Error::io(path, e))
}

/// Writes a rendered view and its error map below `folder`, under the photo's name.
///
/// # Errors
/// [`Error::Io`], or what decoding the photo found.
pub fn write_view(folder: &Path, views: &dyn ViewSource, view: usize, image: &RenderedImage) -> Result<()> {
    let name = image_name(views, view);
    let target = views.target(view)?;
    let put = |path: PathBuf, rgb: &[u8]| {
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        write_png(&path, image.width_px, image.height_px, Channels::Rgb, rgb)
    };
    put(folder.join(&name), &quantised(&image.rgb))?;
    put(folder.join("error").join(&name), &error_map(&image.rgb, &target))
}

/// File name for images of a view: the photo's with the extension `png`, or `png` appended where
/// two photos differ only in their extension. Never leads out of the folder.
pub fn image_name(views: &dyn ViewSource, view: usize) -> PathBuf {
    let name = views.name(view);
    let stem = |name: &str| Path::new(name).with_extension("");
    let shared = (0..views.num_views()).any(|v| v != view && stem(views.name(v)) == stem(name));
    let name = if shared { format!("{name}.png") } else { format!("{}.png", stem(name).display()) };
    let parts = name.split(['/', '\\']).filter(|part| !matches!(*part, "" | "." | ".."));
    parts.map(|part| part.replace(':', "_")).collect()
}

/// Writes the figures of each view as a table.
///
/// # Errors
/// [`Error::Io`].
pub fn write_per_view(path: &Path, evaluation: &Evaluation) -> Result<()> {
    let mut text = String::from("name,psnr,grad_psnr,ssim_3dgs,ssim_valid,flip\n");
    for v in &evaluation.per_view {
        let name = if v.name.contains([',', '"', '\n']) {
            format!("\"{}\"", v.name.replace('"', "\"\""))
        } else {
            v.name.clone()
        };
        text.push_str(&format!(
            "{name},{},{},{},{},{}\n",
            v.psnr, v.grad_psnr, v.ssim_3dgs, v.ssim_valid, v.flip
        ));
    }
    atomic_file::write(path, text.as_bytes())
}
