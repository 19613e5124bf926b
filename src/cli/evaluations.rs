//! Evaluation folders of a run: published atomically; deleting one removes only files that evaluations write.

use super::view_files::PER_VIEW;
use litetex_gs::{Error, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// End of the name of a folder under construction, which begins with a dot.
const STAGED: &str = ".part";

/// A folder under construction; dropped without [`StagedFolder::publish`] it vanishes.
pub struct StagedFolder {
    staging: Option<PathBuf>,
    target: PathBuf,
}

impl StagedFolder {
    /// An empty folder next to `target`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn new(target: PathBuf) -> Result<Self> {
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let staging = target.with_file_name(format!(".{name}{STAGED}"));
        remove(&staging)?;
        fs::create_dir_all(&staging).map_err(|e| Error::io(&staging, e))?;
        Ok(Self { staging: Some(staging), target })
    }

    /// Where to write now.
    pub fn path(&self) -> &Path {
        self.staging.as_deref().unwrap_or(&self.target)
    }

    /// Puts the folder in its place, instead of an earlier evaluation there.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn publish(mut self) -> Result<PathBuf> {
        if let Some(staging) = self.staging.take()
            && let Err(e) = replace_evaluation(&staging, &self.target)
        {
            self.staging = Some(staging);
            return Err(e);
        }
        Ok(self.target.clone())
    }
}

impl Drop for StagedFolder {
    fn drop(&mut self) {
        if let Some(staging) = &self.staging {
            // An error has no reader here; the next run cleans up again.
            let _ = fs::remove_dir_all(staging);
        }
    }
}

/// Moves a new evaluation to its place. Files there that no evaluation writes stay next to it.
fn replace_evaluation(staging: &Path, target: &Path) -> Result<()> {
    remove_evaluation(target, true)?;
    if !target.exists() {
        return fs::rename(staging, target).map_err(|e| Error::io(target, e));
    }
    for entry in entries(staging)? {
        let place = target.join(entry.file_name().unwrap_or_default());
        if entry.is_dir() && place.is_dir() {
            replace_evaluation(&entry, &place)?;
        } else {
            fs::rename(&entry, &place).map_err(|e| Error::io(&place, e))?;
        }
    }
    remove(staging)
}

/// Deletes the images of an evaluation, its table if `table` says so, and the folders that are empty then.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_evaluation(folder: &Path, table: bool) -> Result<()> {
    for entry in entries_or_none(folder)? {
        let is_link = entry.is_symlink();
        if entry.is_dir() && !is_link {
            remove_evaluation(&entry, table)?;
        } else if entry.extension().is_some_and(|e| e == "png")
            || (table && name_of(&entry) == Some(PER_VIEW))
        {
            remove(&entry)?;
        }
    }
    remove_if_empty(folder)
}

/// Deletes the folders under construction that interrupted evaluations have left in `folder`.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_staged(folder: &Path) -> Result<()> {
    for entry in entries_or_none(folder)? {
        if name_of(&entry).is_some_and(|name| name.starts_with('.') && name.ends_with(STAGED)) {
            remove(&entry)?;
        }
    }
    Ok(())
}

/// The name of a file or folder, if it is Unicode.
pub fn name_of(path: &Path) -> Option<&str> {
    path.file_name()?.to_str()
}

/// [`entries`] of a folder that may not exist.
///
/// # Errors
/// [`Error::Io`].
pub fn entries_or_none(folder: &Path) -> Result<Vec<PathBuf>> {
    if folder.is_dir() { entries(folder) } else { Ok(Vec::new()) }
}

/// Paths of what lies in a folder.
///
/// # Errors
/// [`Error::Io`].
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    fs::read_dir(folder)
        .and_then(|all| all.map(|entry| entry.map(|e| e.path())).collect())
        .map_err(|e| Error::io(folder, e))
}

/// Deletes a folder that is empty.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_if_empty(folder: &Path) -> Result<()> {
    if folder.is_dir() && entries(folder)?.is_empty() {
        fs::remove_dir(folder).map_err(|e| Error::io(folder, e))?;
    }
    Ok(())
}

/// Deletes a file or a folder with all its contents, if it exists.
///
/// # Errors
/// [`Error::Io`].
pub fn remove(path: &Path) -> Result<()> {
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
    fn evaluations_are_published_atomically_and_keep_other_files() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("eval/000300");
        let staged = StagedFolder::new(target.clone()).unwrap();
        fs::write(staged.path().join("a.png"), "x").unwrap();
        drop(staged);
        assert!(entries(&dir.path().join("eval")).unwrap().is_empty());
        let mine = target.join("error/notes.txt");
        for content in ["first", "second"] {
            let staged = StagedFolder::new(target.clone()).unwrap();
            fs::create_dir(staged.path().join("error")).unwrap();
            for name in ["a.png", "error/a.png", PER_VIEW] {
                fs::write(staged.path().join(name), content).unwrap();
            }
            assert_eq!(staged.publish().unwrap(), target);
            fs::write(&mine, "mine").unwrap();
        }
        assert_eq!(fs::read_to_string(target.join("error/a.png")).unwrap(), "second");
        remove_evaluation(&target, false).unwrap();
        assert!(!target.join("a.png").exists() && target.join(PER_VIEW).exists());
        remove_evaluation(&target, true).unwrap();
        assert!(!target.join(PER_VIEW).exists() && mine.exists());
        assert_eq!(entries(&dir.path().join("eval")).unwrap().len(), 1, "nothing staged is left");
    }
}
