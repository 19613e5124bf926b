//! Resolves a call of `litetex train`: settings, run folder, and the state of the run to resume.

use super::train_args::TrainArgs;
use litetex_gs::capture::Capture;
use litetex_gs::console::Log;
use litetex_gs::run::{
    Resumed, RunConfig, RunFolder, RunLock, RunState, Summary, checkpoints_after, config_of, find_checkpoint,
    holds_checkpoint, run_of_checkpoint,
};
use litetex_gs::train::{TrainState, checkpoint};
use litetex_gs::verify::CaptureIdentity;
use litetex_gs::views::ViewSource;
use litetex_gs::{Error, Report, Result, invalid, usage};
use std::path::{Path, PathBuf};

/// A training to do.
pub struct TrainJob {
    pub config: RunConfig,
    /// Folder of the run.
    pub out: PathBuf,
    /// Whether to replace the run in the folder, or its later checkpoints.
    pub force: bool,
    pub device: String,
    pub resume: Option<Resume>,
    /// Whether nothing says how long it should be, so that the device decides.
    pub is_free: bool,
    /// The lock of the folder, taken as soon as it is known to hold a run.
    lock: Option<RunLock>,
}

/// A run to continue.
pub struct Resume {
    pub checkpoint: PathBuf,
    pub state: TrainState,
    /// Settings that shape the result and differ from those of the checkpoint.
    pub changed: Vec<String>,
    identity: CaptureIdentity,
    /// Problems of the checkpoint, to be reported.
    pub report: Report,
    /// Whether it continues in its own folder.
    in_place: bool,
}

impl TrainJob {
    /// Resolves the arguments; reads the settings and the checkpoint that they name, and writes nothing.
    ///
    /// # Errors
    /// [`Error::Usage`] for arguments that contradict each other or a folder that may not be used; what reading found.
    pub fn plan(args: &TrainArgs) -> Result<Self> {
        let state = run_state(args)?;
        let mut resumed = resume_source(args, &state)?.map(|path| Resume::load(&path)).transpose()?;
        let before = resumed.as_ref().map(|(_, config)| config);
        let config = resolve_config(args, before)?;
        let out = match (&args.out, &resumed) {
            (Some(out), _) => out.clone(),
            (None, Some((resume, _))) => run_of_checkpoint(&resume.checkpoint)
                .ok_or_else(|| usage!("--out: name the folder of the run"))?,
            (None, None) => {
                return Err(usage!("no output folder given: litetex train <CAPTURE> -o <RUN>"));
            }
        };
        let mut lock = None;
        if let Some((resume, before)) = &mut resumed {
            resume.in_place =
                run_of_checkpoint(&resume.checkpoint).is_some_and(|run| same_folder(&run, &out));
            if args.training.time.is_some() && resume.state.step >= before.train.last_step() {
                return Err(usage!(
                    "--time: the run has all of its {} steps already; continue it with --steps, or start another run with the \
                     time",
                    before.train.last_step()
                ));
            }
            resume.changed = differences(args, &config, before)?;
        }
        let resume = resumed.map(|(resume, _)| resume);
        // A run that was killed before its first checkpoint leaves nothing to keep.
        let force = args.force || matches!(state, RunState::Unfinished { is_saved: false, .. });
        if let Some(resume) = resume.as_ref().filter(|resume| resume.in_place) {
            // Before looking for later checkpoints, which a running training may be about to write.
            lock = Some(RunLock::take(&out)?);
            if !args.force {
                check_latest(&resume.state, &out)?;
            }
        } else {
            check_apart(resume.as_ref(), &out)?;
            RunFolder::check_free(&out, force)?;
        }
        let is_free = resume.is_none() && args.says_no_length();
        Ok(Self { is_free, config, out, force, device: args.device.clone(), resume, lock })
    }

    /// Makes or opens the folder of the run, after which the run of an earlier training may be gone.
    ///
    /// # Errors
    /// [`Error::Usage`] if the folder may not be used (any more), [`Error::Io`].
    pub fn open_folder(&mut self, done: u32) -> Result<RunFolder> {
        let Some(lock) = self.lock.take() else { return RunFolder::create(&self.out, self.force) };
        let folder = RunFolder::reopen(&self.out, lock)?;
        if self.force {
            folder.remove_after(done)?;
        }
        Ok(folder)
    }
}

impl Resume {
    fn load(path: &Path) -> Result<(Self, RunConfig)> {
        let file = find_checkpoint(path)?;
        let (state, strings) = checkpoint::load(&file)?;
        let mut config = config_of(&file, &strings)?;
        if let Some(run) = run_of_checkpoint(&file) {
            config.follow_run(&run)?;
        }
        let identity = CaptureIdentity::from_strings(&file, &strings)?;
        let mut report = Report::default();
        let history = checkpoint::history_path(&file);
        if !history.exists() {
            let what = format!("{}: missing; the times and the curve up to here are lost", history.display());
            report.warn("history-missing", 1, what);
        }
        let resume = Self { checkpoint: file, state, changed: Vec::new(), identity, report, in_place: false };
        Ok((resume, config))
    }

    /// Checks that the run can be continued with these settings on this capture.
    ///
    /// # Errors
    /// [`Error::Usage`], or [`Error::InvalidInput`] for a checkpoint that does not match the capture.
    pub fn check(&self, config: &RunConfig, capture: &Capture) -> Result<()> {
        let fixed =
            ["sh-degree", "policy", "seed", "init", "max-points", "sweep", "backdrop", "exposure", "filter"];
        let section = |key: &String| key.split('.').next().map(str::to_owned).unwrap_or_default();
        if let Some(name) = self.changed.iter().find(|key| fixed.contains(&section(key).as_str())) {
            return Err(usage!(
                "{name}: a resumed run keeps the value of its checkpoint; start a new run to change it"
            ));
        }
        if self.state.step > config.train.last_step() {
            return Err(usage!(
                "--steps {}: the checkpoint is already at step {}",
                config.train.last_step(),
                self.state.step
            ));
        }
        let is_done = self.state.step == config.train.last_step();
        if is_done && self.changed.iter().any(|key| key == "max-bytes") {
            return Err(usage!(
                "--max-size: the run has all of its {} steps already; give it more with --steps, or make a file of that size with \
                 litetex export --max-size",
                self.state.step
            ));
        }
        self.identity.check_resumable(&CaptureIdentity::new(capture, capture.capture_from_local))?;
        if let Some(view) = self.state.epoch_order.iter().find(|&&v| v as usize >= capture.num_views()) {
            return Err(invalid!(
                &self.checkpoint,
                "view {view} of its epoch is not one of the capture's {}: the capture has changed since",
                capture.num_views()
            ));
        }
        Ok(())
    }

    /// Logs where the run continues and what differs, and puts it into the report.
    pub fn announce(&mut self, report: &mut Report, log: &Log) {
        log.report(&self.report);
        report.merge(std::mem::take(&mut self.report));
        log.info(&format!("continuing {} after step {}", self.checkpoint.display(), self.state.step));
        if !self.changed.is_empty() {
            let what = format!(
                "other settings than the checkpoint's ({}): this is a new schedule, not the continuation of the old run",
                self.changed.join(", ")
            );
            log.warn("resumed-with-other-settings", &what, self.changed.len());
        }
    }

    /// How the summary describes it.
    pub fn summary(&self) -> Resumed {
        Resumed {
            from_step: self.state.step,
            new_schedule: !self.changed.is_empty(),
            changed: self.changed.clone(),
        }
    }
}

/// A run that `--resume-or-start` finds finished.
pub struct Finished {
    pub summary: Summary,
    /// Settings that shape the result and differ from those that the arguments ask for.
    pub changed: Vec<String>,
}

/// The finished run that is left as it is, if there is one.
///
/// # Errors
/// [`Error::Usage`] if it is of another capture, or for wrong arguments.
pub fn finished(args: &TrainArgs) -> Result<Option<Finished>> {
    let RunState::Finished { config, summary } = run_state(args)? else { return Ok(None) };
    let changed = differences(args, &resolve_config(args, Some(&config))?, &config)?;
    Ok(Some(Finished { summary: *summary, changed }))
}

/// Settings that shape the result and that the arguments change against those of a run, its time included.
fn differences(args: &TrainArgs, config: &RunConfig, before: &RunConfig) -> Result<Vec<String>> {
    let mut changed = config.shaping_differences(before)?;
    if args.training.time.is_some()
        && (config.time_secs, config.most_steps) != (before.time_secs, before.most_steps)
    {
        changed.push("time".to_owned());
    }
    if config.train.last_step() != before.train.last_step() && !changed.iter().any(|key| key == "steps") {
        // A plan has changed them since.
        changed.push("steps".to_owned());
    }
    Ok(changed)
}

/// Refuses settings that no run can have.
///
/// # Errors
/// [`Error::Usage`], [`Error::InvalidInput`] for the file of `--config`.
pub fn check_settings(args: &TrainArgs) -> Result<()> {
    resolve_config(args, None).map(drop)
}

/// The state of the run in the output folder, where it matters.
fn run_state(args: &TrainArgs) -> Result<RunState> {
    let Some(out) = args.out.as_deref().filter(|_| args.resume_or_start) else { return Ok(RunState::None) };
    let state = RunState::of(out)?;
    if let Some(capture) = args.captures.first() {
        state.check_capture(out, capture)?;
    }
    Ok(state)
}

/// The run or checkpoint to continue, if any.
fn resume_source(args: &TrainArgs, state: &RunState) -> Result<Option<PathBuf>> {
    match (&args.resume, &args.out) {
        (None, Some(out)) if matches!(state, RunState::Unfinished { is_saved: true, .. }) => {
            Ok(Some(out.clone()))
        }
        (None, _) => Ok(None),
        (Some(Some(path)), _) | (Some(None), Some(path)) => Ok(Some(path.clone())),
        (Some(None), None) => Err(usage!("--resume: name the run here or with --out")),
    }
}

/// The settings: of `--config`, else of the run that is continued (`before`), else the defaults; flags win.
fn resolve_config(args: &TrainArgs, before: Option<&RunConfig>) -> Result<RunConfig> {
    let mut config = match (&args.config, before) {
        (Some(file), before) => {
            let mut config = RunConfig::read(file)?;
            config.forget_time();
            if let (None, Some(before)) = (&config.data, before) {
                config.data.clone_from(&before.data);
            }
            config
        }
        (None, Some(before)) => before.clone(),
        (None, None) => RunConfig::default(),
    };
    args.apply(&mut config)?;
    config.version.clear();
    if let Some(data) = &config.data {
        // The run must be repeatable from any folder.
        config.data = Some(std::path::absolute(data).map_err(|e| Error::io(data, e))?);
    }
    config.data()?;
    // Every run records its settings: what cannot be written is refused before any work.
    config.to_toml()?;
    Ok(config)
}

/// Refuses to continue from the middle of a run: later checkpoints would be mixed with new ones.
fn check_latest(state: &TrainState, run: &Path) -> Result<()> {
    match checkpoints_after(run, state.step)?.last() {
        None => Ok(()),
        Some(last) => Err(usage!(
            "the run has checkpoints after step {}, up to {}; continue it elsewhere with -o <RUN>, or add \
             --force to delete the later checkpoints and evaluations",
            state.step,
            last.display()
        )),
    }
}

/// Refuses to replace a folder that holds the checkpoint to continue from.
fn check_apart(resume: Option<&Resume>, out: &Path) -> Result<()> {
    match resume.filter(|resume| holds_checkpoint(out, &resume.checkpoint)) {
        None => Ok(()),
        Some(resume) => Err(usage!(
            "{}: the folder holds the checkpoint to continue from, {}; choose another folder, or name the checkpoint \
             in checkpoints/ of its run",
            out.display(),
            resume.checkpoint.display()
        )),
    }
}

fn same_folder(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}
