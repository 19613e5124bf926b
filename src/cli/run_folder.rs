//! The folder of a run: its layout, its lock, and what may be deleted. The contents of the files are written elsewhere.

use super::evaluations::{
    StagedFolder, entries, entries_or_none, is_folder, name_of, name_of_step, remove_evaluation, remove_file,
    remove_if_empty, remove_staged, step_of_name,
};
use litetex_gs::{Error, Result};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

/// Files that a run writes next to the folders of its checkpoints and evaluations.
const FILES: [&str; 3] = ["config.toml", "metrics.jsonl", "summary.json"];
const CHECKPOINTS: &str = "checkpoints";
const EVALUATIONS: &str = "eval";
/// The file that a training keeps locked. The lock ends with the process; the file stays and does no harm.
const LOCK: &str = ".litetex-train.lock";

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
    /// [`Error::Usage`] if another training holds the lock, [`Error::Io`].
    pub fn take(root: &Path) -> Result<Self> {
        let path = root.join(LOCK);
        let file = File::options().write(true).create(true).truncate(false).open(&path);
        let file = file.map_err(|e| Error::io(&path, e))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(Error::Usage(format!(
                "{}: another training is writing into this folder; wait until it ends, or choose another folder with \
                 --out",
                root.display()
            ))),
            // Not every file system has locks; two trainings in one folder are the user's risk there.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self(file)),
        }
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
        let refuse = |what: &str| Err(Error::Usage(format!("{}: {what}", root.display())));
        match (is_run(root), force) {
            (true, true) => Ok(()),
            (true, false) => {
                refuse("the folder already holds a run; --force replaces it, --resume continues it")
            }
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

    /// The folder of a run that is continued; leftovers of an interrupted evaluation are deleted.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn reopen(root: &Path, lock: RunLock) -> Result<Self> {
        let folder = Self { root: root.to_owned(), _lock: lock };
        remove_staged(&folder.root.join(EVALUATIONS))?;
        Ok(folder)
    }

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

    /// Deletes the checkpoints, their histories and the evaluations of later steps.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_after(&self, step: u32) -> Result<()> {
        for entry in entries_or_none(&self.root.join(CHECKPOINTS))? {
            if step_of_checkpoint_file(&entry).is_some_and(|s| s > step) {
                remove_file(&entry)?;
            }
        }
        for entry in entries_or_none(&self.root.join(EVALUATIONS))? {
            if step_of_evaluation(&entry).is_some_and(|s| s > step) {
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
        let checkpoints = self.root.join(CHECKPOINTS);
        for entry in entries_or_none(&checkpoints)? {
            let is_leftover =
                name_of(&entry).is_some_and(|n| n.starts_with(".step-") && n.ends_with(".part"));
            if is_leftover || step_of_checkpoint_file(&entry).is_some() {
                remove_file(&entry)?;
            }
        }
        let evaluations = self.root.join(EVALUATIONS);
        for entry in entries_or_none(&evaluations)? {
            if step_of_evaluation(&entry).is_some() {
                remove_evaluation(&entry, true)?;
            }
        }
        remove_if_empty(&checkpoints)?;
        remove_if_empty(&evaluations)
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
    Err(Error::Usage(format!("{}: the folder is not empty; choose another", folder.display())))
}

/// Whether a folder does not exist or holds nothing but the file of a lock.
fn is_empty_or_missing(folder: &Path) -> Result<bool> {
    if !folder.exists() {
        return Ok(true);
    }
    if !folder.is_dir() {
        return Err(Error::Usage(format!("{}: is a file, expected a folder", folder.display())));
    }
    Ok(entries(folder)?.iter().all(|entry| name_of(entry) == Some(LOCK)))
}

/// Whether a run has written into a folder: the first thing it writes are its settings, with the version.
pub fn is_run(folder: &Path) -> bool {
    let file = folder.join("config.toml");
    let settings = file.is_file().then(|| fs::read_to_string(&file).ok()).flatten();
    let settings = settings.and_then(|text| text.parse::<toml::Table>().ok());
    settings.is_some_and(|table| table.contains_key("version") && table.contains_key("train"))
}

/// The checkpoint that a file is, or the last one in the folder of a run.
///
/// # Errors
/// [`Error::InvalidInput`] if there is none, [`Error::Io`].
pub fn find_checkpoint(path: &Path) -> Result<PathBuf> {
    if path.is_file() {
        return Ok(path.to_owned());
    }
    if !path.exists() {
        return Err(Error::io(path, std::io::ErrorKind::NotFound.into()));
    }
    checkpoints(path)?.pop().map(|(_, file)| file).ok_or_else(|| {
        Error::invalid(path, "no checkpoint: expected checkpoints/step-*.safetensors in the folder of a run")
    })
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

/// The run's folder that a checkpoint lies in, if it does.
pub fn run_of_checkpoint(checkpoint: &Path) -> Option<&Path> {
    let folder = checkpoint.parent()?;
    (folder.file_name()? == CHECKPOINTS).then(|| folder.parent())?
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with files of these names.
    fn folder_with(names: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for name in names {
            let path = dir.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            let text = match path.file_name().and_then(|name| name.to_str()) {
                Some("config.toml") => "version = \"0.1.0\"\n[train]\n",
                Some(PER_VIEW) => TABLE,
                _ => "x",
            };
            fs::write(path, text).unwrap();
        }
        dir
    }

    fn files_below(folder: &Path) -> Vec<String> {
        let mut found = Vec::new();
        for entry in entries(folder).unwrap() {
            let name = name_of(&entry).unwrap().to_owned();
            match entry.is_dir() {
                true => found.extend(files_below(&entry).into_iter().map(|n| format!("{name}/{n}"))),
                false => found.push(name),
            }
        }
        found.sort();
        found
    use crate::cli::view_files::PER_VIEW;

    /// Of one view, `a/0001.jpg`.
    const TABLE: &str = "name,psnr,grad_psnr,ssim_3dgs,ssim_valid,flip\na/0001.jpg,1,1,1,1,1\n";
    }

    #[test]
    fn force_replaces_a_run_and_nothing_else() {
        let foreign = ["checkpoints/best.pt", "eval/notes.txt", "summary.json"];
        let dir = folder_with(&foreign);
        for force in [false, true] {
            let error = RunFolder::create(dir.path(), force).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains("not empty"), "{error}");
        }
        assert_eq!(files_below(dir.path()), foreign);

        let dir = folder_with(&[
            "config.toml",
            "metrics.jsonl",
            "summary.json",
            "checkpoints/step-000010.safetensors",
            "checkpoints/step-000010.history.json",
            "checkpoints/.step-000020.safetensors.7.part",
            "checkpoints/step-final.safetensors",
            "eval/000010/a/0001.png",
            "eval/000010/error/a/0001.png",
            "eval/000010/per_view.csv",
            "eval/000010/notes.txt",
            "eval/2024/trip.png",
            "thesis.doc",
        ]);
        let error = RunFolder::create(dir.path(), false).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("--force"), "{error}");
        drop(RunFolder::create(dir.path(), true).unwrap());
        let left = [
            LOCK,
            "checkpoints/step-final.safetensors",
            "eval/000010/notes.txt",
            "eval/2024/trip.png",
            "thesis.doc",
        ];
        assert_eq!(files_below(dir.path()), left);
    }

    #[test]
    fn a_folder_is_locked_as_long_as_a_run_uses_it() {
        let dir = tempfile::tempdir().unwrap();
        let first = RunFolder::create(dir.path(), false).unwrap();
        let error = RunFolder::create(dir.path(), true).unwrap_err();
        let named = error.to_string().contains(&dir.path().display().to_string());
        assert!(error.exit_code() == 2 && named, "{error}");
            "eval/000010/comparison.png",
        drop(first);
        // The file is still there.
            "eval/20240101/trip/beach.png",
        assert_eq!(files_below(dir.path()), [LOCK]);
        RunFolder::create(dir.path(), false).unwrap();
    }

    #[test]
    fn the_last_checkpoint_is_the_one_with_the_highest_step() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(find_checkpoint(dir.path()).unwrap_err().exit_code(), 3);
            "eval/000010/comparison.png",
        let run = RunFolder::create(dir.path(), false).unwrap();
        for step in [999_999, 1_000_000, 300] {
            "eval/20240101/trip/beach.png",
            fs::write(run.checkpoint(step).unwrap(), "").unwrap();
        }
        fs::write(dir.path().join("checkpoints/.step-2000000.safetensors.1.part"), "").unwrap();
        let last = find_checkpoint(dir.path()).unwrap();
        assert!(last.ends_with("checkpoints/step-1000000.safetensors"));
        assert_eq!(run_of_checkpoint(&last), Some(dir.path()));
        assert_eq!(checkpoints_after(dir.path(), 300).unwrap().len(), 2);
        fs::write(dir.path().join("checkpoints/step-999999.history.json"), "").unwrap();
        for step in [300, 999_999] {
            fs::create_dir_all(run.eval(step)).unwrap();
        }
        run.remove_after(300).unwrap();
        assert!(find_checkpoint(dir.path()).unwrap().ends_with("step-000300.safetensors"));
        assert!(run.eval(300).exists() && !run.eval(999_999).exists());
        assert!(!dir.path().join("checkpoints/step-999999.history.json").exists());
    }
}
            fs::write(run.eval(step).join(PER_VIEW), TABLE).unwrap();
