//! The folder of a run: its layout, its lock, and what may be deleted. The contents of the files are written elsewhere.

use super::config::{FILE_BYTES_MAX, RunConfig};
use super::evaluations::{
    StagedFolder, entries, entries_or_none, is_folder, name_of, name_of_step, remove_evaluation, remove_file,
    remove_if_empty, remove_staged, step_of_name,
};
use super::scale::SCALE_FILE;
use crate::text::shell_word;
use crate::{Error, Result, atomic_file, input_file};
use litetex_exporters::unknown_kind;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Files that a run writes next to the folders of its checkpoints and evaluations.
const FILES: [&str; 6] = ["config.toml", "metrics.jsonl", "summary.json", SCENE, PREVIEW, SCALE_FILE];
/// The file of a run that has a wanted size.
pub const SCENE: &str = "scene.ltgs";
/// The model of a training that is under way, as its page shows it: a `.ltgs` file that is replaced every few seconds.
pub const PREVIEW: &str = "preview.ltgs";
const CHECKPOINTS: &str = "checkpoints";
const EVALUATIONS: &str = "eval";
/// The file that a training keeps locked. The lock ends with the process; the file stays and does no harm.
pub(super) const LOCK: &str = ".litetex-train.lock";
/// How often, and after which pauses, a lock that is taken is tried again.
const LOCK_TRIES: u32 = 5;
const LOCK_PAUSE: Duration = Duration::from_millis(10);

/// The folder of a run, locked against other trainings until it is dropped.
#[derive(Debug)]
pub struct RunFolder {
    root: PathBuf,
    _lock: RunLock,
}

/// Keeps other trainings out of a folder until it is dropped or the process ends.
#[derive(Debug)]
pub struct RunLock(#[expect(dead_code, reason = "holds the lock")] File);

impl RunLock {
    /// Locks a folder that exists.
    ///
    /// # Errors
    /// [`Error::Usage`] if another training holds the lock or the place of its file is taken, [`Error::Io`].
    pub fn take(root: &Path) -> Result<Self> {
        let path = root.join(LOCK);
        atomic_file::check_place(&path)?;
        let file = File::options().write(true).create(true).truncate(false).open(&path);
        let file = file.map_err(|e| Error::io(&path, e))?;
        // Whoever asks whether the lock is taken holds it for a moment.
        let mut outcome = file.try_lock();
        for _ in 0..LOCK_TRIES {
            if !matches!(outcome, Err(TryLockError::WouldBlock)) {
                break;
            }
            std::thread::sleep(LOCK_PAUSE);
            outcome = file.try_lock();
        }
        match outcome {
            Err(TryLockError::WouldBlock) => Err(usage!(
                "{}: another training is writing into this folder; wait until it ends, or choose another folder with \
                 --out",
                root.display()
            )),
            // Not every file system has locks; two trainings in one folder are the user's risk there.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self(file)),
        }
    }

    /// Whether a training is writing into a folder. Where file systems have no locks, the answer is no.
    pub fn is_taken(root: &Path) -> bool {
        let file = File::open(root.join(LOCK));
        file.is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }
}

impl RunFolder {
    /// Refuses a folder that a new run may not use. Changes nothing.
    ///
    /// # Errors
    /// [`Error::Usage`] for a folder that is not empty, unless it holds a run and `force` is set; [`Error::Io`].
    pub fn check_free(root: &Path, force: bool) -> Result<()> {
        if is_empty_or_missing(root)? {
            return Ok(());
        }
        let refuse = |what: &str| Err(usage!("{}: {what}", root.display()));
        match (is_run(root), force) {
            (true, true) => Ok(()),
            // For a run of many as well, which --resume does not continue.
            (true, false) => refuse(
                "the folder already holds a run; --resume-or-start continues it if it is unfinished, --force replaces it",
            ),
            (false, true) => refuse(
                "the folder is not empty and holds no run; --force replaces only runs, choose another folder",
            ),
            (false, false) => refuse("the folder is not empty; choose another"),
        }
    }

    /// Makes the folder of a new run and, with `force`, deletes the files of the run in it.
    ///
    /// # Errors
    /// As [`RunFolder::check_free`] and [`RunLock::take`].
    pub fn create(root: &Path, force: bool) -> Result<Self> {
        Self::check_free(root, force)?;
        fs::create_dir_all(root).map_err(|e| Error::io(root, e))?;
        let lock = RunLock::take(root)?;
        // Another training may have begun between the first check and the lock.
        Self::check_free(root, force)?;
        let folder = Self::reopen(root, lock)?;
        folder.delete_run()?;
        Ok(folder)
    }

    /// The folder of a run that is continued; leftovers of an interrupted evaluation, an old preview and an old
    /// scene are deleted.
    ///
    /// # Errors
    /// [`Error::Usage`] if the place of a file is taken by a device, a pipe or a folder; [`Error::Io`].
    pub fn reopen(root: &Path, lock: RunLock) -> Result<Self> {
        FILES.iter().try_for_each(|name| atomic_file::check_place(&root.join(name)))?;
        let folder = Self { root: root.to_owned(), _lock: lock };
        remove_staged(&folder.root.join(EVALUATIONS))?;
        remove_file(&folder.root.join(PREVIEW))?;
        remove_file(&folder.root.join(SCENE))?;
        folder.remove_unfinished_checkpoints()?;
        Ok(folder)
    }

    /// Deletes what a run that was killed while it saved has left.
    fn remove_unfinished_checkpoints(&self) -> Result<()> {
        for entry in entries_or_none(&self.root.join(CHECKPOINTS))? {
            if name_of(&entry).is_some_and(|n| n.starts_with(".step-") && n.ends_with(".part")) {
                remove_file(&entry)?;
            }
        }
        Ok(())
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Path of the resolved settings.
    pub fn config(&self) -> PathBuf {
        self.root.join("config.toml")
    }

    /// Path of the events, one JSON object per line.
    pub fn metrics(&self) -> PathBuf {
        self.root.join("metrics.jsonl")
    }

    /// Path of the result.
    pub fn summary(&self) -> PathBuf {
        self.root.join("summary.json")
    }

    /// Folder with the images and figures of the evaluation after `step`.
    pub fn eval(&self, step: u32) -> PathBuf {
        self.root.join(EVALUATIONS).join(name_of_step(step))
    }

    /// Path of the checkpoint after `step`; its folder is made.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn checkpoint(&self, step: u32) -> Result<PathBuf> {
        let folder = self.root.join(CHECKPOINTS);
        fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        Ok(folder.join(format!("step-{step:06}.safetensors")))
    }

    /// An empty folder that becomes [`RunFolder::eval`] when it is complete.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn stage_eval(&self, step: u32) -> Result<StagedFolder> {
        StagedFolder::new(self.eval(step))
    }

    /// Deletes the checkpoint after a step and its history.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_checkpoint(&self, step: u32) -> Result<()> {
        for entry in entries_or_none(&self.root.join(CHECKPOINTS))? {
            if step_of_checkpoint_file(&entry) == Some(step) {
                remove_file(&entry)?;
            }
        }
        Ok(())
    }

    /// Deletes the checkpoints, their histories and the evaluations of later steps.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_after(&self, step: u32) -> Result<()> {
        self.remove_steps(|s| s > step)
    }

    fn remove_steps(&self, is_removed: impl Fn(u32) -> bool) -> Result<()> {
        for entry in entries_or_none(&self.root.join(CHECKPOINTS))? {
            if step_of_checkpoint_file(&entry).is_some_and(&is_removed) {
                remove_file(&entry)?;
            }
        }
        for entry in entries_or_none(&self.root.join(EVALUATIONS))? {
            if step_of_evaluation(&entry).is_some_and(&is_removed) {
                remove_evaluation(&entry, true)?;
            }
        }
        Ok(())
    }

    /// Deletes the images of an evaluation; its table stays.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn drop_images(&self, step: u32) -> Result<()> {
        remove_evaluation(&self.eval(step), false)
    }

    /// Deletes what a run has written. Anything else stays, and with it the folders that hold it.
    fn delete_run(&self) -> Result<()> {
        for name in FILES {
            remove_file(&self.root.join(name))?;
        }
        self.remove_steps(|_| true)?;
        remove_if_empty(&self.root.join(CHECKPOINTS))?;
        remove_if_empty(&self.root.join(EVALUATIONS))
    }
}

/// Refuses a folder that holds something, for commands that fill an empty one. Changes nothing.
///
/// # Errors
/// [`Error::Usage`], [`Error::Io`].
pub fn check_empty(folder: &Path) -> Result<()> {
    if is_empty_or_missing(folder)? {
        return Ok(());
    }
    Err(usage!("{}: the folder is not empty; choose another", folder.display()))
}

/// Whether a folder does not exist or holds nothing but the file of a lock.
fn is_empty_or_missing(folder: &Path) -> Result<bool> {
    if folder.as_os_str().is_empty() {
        return Err(usage!("the name of the output folder is empty; name a folder, or . for this one"));
    }
    if !folder.exists() {
        return Ok(true);
    }
    if !folder.is_dir() {
        return Err(usage!("{}: is a file, expected a folder", folder.display()));
    }
    Ok(entries(folder)?.iter().all(|entry| name_of(entry) == Some(LOCK)))
}

/// Whether a run has written into a folder: the first thing it writes are its settings, with the version.
pub fn is_run(folder: &Path) -> bool {
    let file = folder.join("config.toml");
    let Ok(text) = input_file::read_text(&file, FILE_BYTES_MAX) else { return false };
    let settings = text.parse::<toml::Table>().unwrap_or_default();
    // Settings of other programs may have both, but not only keys of ours.
    settings.contains_key("version")
        && settings.contains_key("train")
        && RunConfig::parse(&file, &text).is_ok()
}

/// What names a trained model, for messages.
pub const RUN_OR_CHECKPOINT: &str = "the folder of a run or one of its checkpoints (step-*.safetensors)";

/// Whether a path is that of a checkpoint.
pub fn is_checkpoint(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|e| e == "safetensors")
}

/// The checkpoint that a file is, or the last one in the folder of a run.
///
/// # Errors
/// [`Error::InvalidInput`] if there is none, [`Error::Io`].
pub fn find_checkpoint(path: &Path) -> Result<PathBuf> {
    if is_checkpoint(path) {
        return Ok(path.to_owned());
    }
    if path.is_file() {
        return Err(unknown_kind(path, RUN_OR_CHECKPOINT).into());
    }
    input_file::check_exists(path)?;
    checkpoints(path)?.pop().map(|(_, file)| file).ok_or_else(|| Error::invalid(path, no_checkpoint(path)))
}

/// Says why a folder has no checkpoint, and what to do.
fn no_checkpoint(path: &Path) -> String {
    if RunLock::is_taken(path) {
        return "no checkpoint yet: a training is writing into this folder; wait for its first one"
            .to_owned();
    }
    if is_run(path) {
        let (config, run) = (shell_word(&path.join("config.toml")), shell_word(path));
        return format!(
            "no checkpoint: the run was interrupted before its first one; start it again with: litetex train --config \
             {config} -o {run} --force"
        );
    }
    "no checkpoint: expected checkpoints/step-*.safetensors in the folder of a run; a capture is to be trained first: \
     litetex train"
        .to_owned()
}

/// Checkpoints of a run after `step`, in order.
///
/// # Errors
/// [`Error::Io`].
pub fn checkpoints_after(run: &Path, step: u32) -> Result<Vec<PathBuf>> {
    Ok(checkpoints(run)?.into_iter().filter(|(s, _)| *s > step).map(|(_, file)| file).collect())
}

/// Checkpoints of a run with their steps, in order.
fn checkpoints(run: &Path) -> Result<Vec<(u32, PathBuf)>> {
    let all = entries_or_none(&run.join(CHECKPOINTS))?.into_iter();
    let mut found: Vec<_> = all.filter_map(|p| Some((step_of(&p, ".safetensors")?, p))).collect();
    found.sort();
    Ok(found)
}

/// The run's folder that a checkpoint lies in, if it does; absolute, since of `checkpoints/step-000300.safetensors` alone
/// it would have no name.
pub fn run_of_checkpoint(checkpoint: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(checkpoint).ok()?;
    let folder = absolute.parent()?;
    // The folder of the checkpoints may be a link to another disk, and `..` has no name of its own.
    let run_of = |folder: &Path| {
        let run = folder.file_name().filter(|name| *name == CHECKPOINTS).and(folder.parent());
        run.map(Path::to_owned)
    };
    run_of(folder).or_else(|| run_of(&folder.canonicalize().ok()?))
}

/// Whether a checkpoint is among the files of the folder of a run, under whatever name, and so would be deleted with them.
pub fn holds_checkpoint(run: &Path, checkpoint: &Path) -> bool {
    let Ok(checkpoint) = checkpoint.canonicalize() else { return false };
    [run, &run.join(CHECKPOINTS)].iter().any(|f| f.canonicalize().is_ok_and(|f| checkpoint.starts_with(f)))
}

/// The step of a checkpoint or of its history.
fn step_of_checkpoint_file(path: &Path) -> Option<u32> {
    step_of(path, ".safetensors").or_else(|| step_of(path, ".history.json"))
}

fn step_of(path: &Path, suffix: &str) -> Option<u32> {
    name_of(path)?.strip_prefix("step-")?.strip_suffix(suffix)?.parse().ok()
}

/// The step of a folder with an evaluation. A link to a folder is none: what lies there is not the run's.
fn step_of_evaluation(path: &Path) -> Option<u32> {
    name_of(path).filter(|_| is_folder(path)).and_then(step_of_name)
}
