//! The folder of a run: which file lies where, who may write into it, and evaluations that appear
//! whole or not at all. What the files say is written elsewhere.

use litetex_gs::{Error, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// What a run writes; `--force` removes these and nothing else.
const OURS: [&str; 5] = ["config.toml", "metrics.jsonl", "summary.json", "checkpoints", "eval"];

/// The folder of a run.
#[derive(Clone, Debug)]
pub struct RunFolder {
    root: PathBuf,
}

impl RunFolder {
    /// Refuses a folder that holds something, unless it may be replaced. Touches nothing.
    ///
    /// # Errors
    /// [`Error::Usage`] if the folder is not empty, [`Error::Io`].
    pub fn check_free(root: &Path, force: bool) -> Result<()> {
        if root.is_file() {
            return Err(Error::Usage(format!("{}: is a file, not a folder", root.display())));
        }
        if force || !root.exists() || entries(root)?.is_empty() {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "{}: the output folder is not empty; --force replaces the run in it, --resume continues it",
            root.display()
        )))
    }

    /// Makes the folder and, with `force`, removes an earlier run's files.
    ///
    /// # Errors
    /// As [`RunFolder::check_free`].
    pub fn create(root: &Path, force: bool) -> Result<Self> {
        Self::check_free(root, force)?;
        let folder = Self::reopen(root)?;
        for name in OURS {
            remove(&root.join(name))?;
        }
        Ok(folder)
    }

    /// An existing folder, to be continued.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn reopen(root: &Path) -> Result<Self> {
        fs::create_dir_all(root).map_err(|e| Error::io(root, e))?;
        let folder = Self { root: root.to_owned() };
        // What an interrupted evaluation left behind.
        for entry in entries(&folder.root.join("eval")).unwrap_or_default() {
            let name = entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with('.') && name.ends_with(".part") {
                remove(&entry)?;
            }
        }
        Ok(folder)
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Resolved settings.
    pub fn config(&self) -> PathBuf {
        self.root.join("config.toml")
    }

    /// Events, one JSON object a line.
    pub fn metrics(&self) -> PathBuf {
        self.root.join("metrics.jsonl")
    }

    /// Result.
    pub fn summary(&self) -> PathBuf {
        self.root.join("summary.json")
    }

    /// Images and figures of the evaluation after `step`.
    pub fn eval(&self, step: u32) -> PathBuf {
        self.root.join("eval").join(format!("{step:06}"))
    }

    /// Checkpoint after `step`; its folder is made.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn checkpoint(&self, step: u32) -> Result<PathBuf> {
        let folder = self.root.join("checkpoints");
        fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        Ok(folder.join(format!("step-{step:06}.safetensors")))
    }

    /// An empty folder that becomes [`RunFolder::eval`] when it is complete.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn stage_eval(&self, step: u32) -> Result<StagedFolder> {
        let staging = self.root.join("eval").join(format!(".{step:06}.part"));
        remove(&staging)?;
        fs::create_dir_all(&staging).map_err(|e| Error::io(&staging, e))?;
        Ok(StagedFolder { staging: Some(staging), target: self.eval(step) })
    }

    /// Removes checkpoints, their histories and evaluations of later steps.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_after(&self, step: u32) -> Result<()> {
        let folder = self.root.join("checkpoints");
        for entry in entries_or_none(&folder)? {
            if step_of(&entry, ".safetensors").or(step_of(&entry, ".history.json")).is_some_and(|s| s > step)
            {
                remove(&entry)?;
            }
        }
        for entry in entries_or_none(&self.root.join("eval"))? {
            let name = entry.file_name().unwrap_or_default().to_str();
            if name.and_then(|n| n.parse().ok()).is_some_and(|s: u32| s > step) {
                remove(&entry)?;
            }
        }
        Ok(())
    }

    /// Removes the images of an evaluation; its table stays.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn drop_images(&self, step: u32) -> Result<()> {
        for entry in entries(&self.eval(step)).unwrap_or_default() {
            if entry.extension().is_none_or(|e| e != "csv") {
                remove(&entry)?;
            }
        }
        Ok(())
    }
}

/// A folder under construction; dropped without [`StagedFolder::publish`] it vanishes.
pub struct StagedFolder {
    staging: Option<PathBuf>,
    target: PathBuf,
}

impl StagedFolder {
    /// Where to write now.
    pub fn path(&self) -> &Path {
        self.staging.as_deref().unwrap_or(&self.target)
    }

    /// Puts the folder in its place, instead of whatever was there.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn publish(mut self) -> Result<PathBuf> {
        if let Some(staging) = self.staging.take() {
            let moved = remove(&self.target)
                .and_then(|()| fs::rename(&staging, &self.target).map_err(|e| Error::io(&self.target, e)));
            if let Err(e) = moved {
                self.staging = Some(staging);
                return Err(e);
            }
        }
        Ok(self.target.clone())
    }
}

impl Drop for StagedFolder {
    fn drop(&mut self) {
        if let Some(staging) = &self.staging {
            // Nobody is left to tell; the next run cleans up again.
            let _ = fs::remove_dir_all(staging);
        }
    }
}

/// The checkpoint that is meant by a file, or the last one of a run's folder.
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

/// Checkpoints of a run by step.
fn checkpoints(run: &Path) -> Result<Vec<(u32, PathBuf)>> {
    let all = entries_or_none(&run.join("checkpoints"))?.into_iter();
    let mut found: Vec<_> = all.filter_map(|p| Some((step_of(&p, ".safetensors")?, p))).collect();
    found.sort();
    Ok(found)
}

fn step_of(path: &Path, suffix: &str) -> Option<u32> {
    path.file_name()?.to_str()?.strip_prefix("step-")?.strip_suffix(suffix)?.parse().ok()
}

fn entries_or_none(folder: &Path) -> Result<Vec<PathBuf>> {
    if folder.is_dir() { entries(folder) } else { Ok(Vec::new()) }
}

/// The run's folder that a checkpoint lies in, if it does.
pub fn run_of_checkpoint(checkpoint: &Path) -> Option<&Path> {
    let folder = checkpoint.parent()?;
    (folder.file_name()? == "checkpoints").then(|| folder.parent())?
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    fs::read_dir(folder)
        .and_then(|all| all.map(|entry| entry.map(|e| e.path())).collect())
        .map_err(|e| Error::io(folder, e))
}

fn remove(path: &Path) -> Result<()> {
    let removed = match fs::symlink_metadata(path) {
        Ok(meta) if meta.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(_) => Ok(()),
    };
    removed.map_err(|e| Error::io(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_foreign_folder_is_refused_and_force_removes_only_a_run() {
        let dir = tempfile::tempdir().unwrap();
        RunFolder::create(dir.path(), false).unwrap();
        fs::write(dir.path().join("thesis.doc"), "years").unwrap();
        fs::write(dir.path().join("summary.json"), "{}").unwrap();
        let error = RunFolder::create(dir.path(), false).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("--force"), "{error}");
        RunFolder::create(dir.path(), true).unwrap();
        assert!(dir.path().join("thesis.doc").exists());
        assert!(!dir.path().join("summary.json").exists());
    }

    #[test]
    fn evaluations_appear_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let run = RunFolder::create(dir.path(), false).unwrap();
        let staged = run.stage_eval(300).unwrap();
        fs::write(staged.path().join("a.png"), "x").unwrap();
        drop(staged);
        assert!(entries(&dir.path().join("eval")).unwrap().is_empty());
        for content in ["first", "second"] {
            let staged = run.stage_eval(300).unwrap();
            fs::write(staged.path().join("a.png"), content).unwrap();
            fs::write(staged.path().join("per_view.csv"), content).unwrap();
            assert_eq!(staged.publish().unwrap(), dir.path().join("eval/000300"));
        }
        assert_eq!(fs::read_to_string(run.eval(300).join("a.png")).unwrap(), "second");
        run.drop_images(300).unwrap();
        assert_eq!(entries(&run.eval(300)).unwrap().len(), 1);
    }

    #[test]
    fn the_last_checkpoint_is_the_one_with_the_highest_step() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(find_checkpoint(dir.path()).unwrap_err().exit_code(), 3);
        let run = RunFolder::create(dir.path(), false).unwrap();
        for step in [999_999, 1_000_000, 300] {
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
