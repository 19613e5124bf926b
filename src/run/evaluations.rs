//! Evaluation folders of a run: published atomically; deleting one removes only files that evaluations write.

use super::view_files::{ERROR_MAPS, PER_VIEW, image_names, views_of_table};
use crate::{Error, Result};
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
    merge(staging, target)
}

/// Moves a folder to its place, or what it holds next to what is there. A link there is replaced, not followed.
fn merge(from: &Path, to: &Path) -> Result<()> {
    if to.is_symlink() {
        fs::remove_file(to).map_err(|e| Error::io(to, e))?;
    }
    if !(is_folder(from) && is_folder(to)) {
        return fs::rename(from, to).map_err(|e| Error::io(to, e));
    }
    for entry in entries(from)? {
        merge(&entry, &to.join(entry.file_name().unwrap_or_default()))?;
    }
    remove(from)
}

/// Deletes the images of an evaluation, its table if `table` says so, and the folders that are empty then. Which images
/// are its own, the table tells: a folder without it is no evaluation, and other files stay.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_evaluation(folder: &Path, table: bool) -> Result<()> {
    let Some(views) = is_folder(folder).then(|| views_of_table(folder)).flatten() else { return Ok(()) };
    for name in views.iter().flat_map(|view| image_names(view)) {
        remove_inner(folder, &name)?;
        remove_inner(folder, &Path::new(ERROR_MAPS).join(name))?;
    }
    if table {
        // The last, since without it the images could not be told from others.
        remove_inner(folder, Path::new(PER_VIEW))?;
    }
    remove_if_empty(folder)
}

/// Deletes the file `name` below `folder`, and the folders on the way to it that are empty then; follows no links.
fn remove_inner(folder: &Path, name: &Path) -> Result<()> {
    let between = || name.ancestors().skip(1).filter(|inner| !inner.as_os_str().is_empty());
    if between().any(|inner| !is_folder(&folder.join(inner))) {
        return Ok(());
    }
    remove_file(&folder.join(name))?;
    between().try_for_each(|inner| remove_if_empty(&folder.join(inner)))
}

/// Deletes the folders under construction that interrupted evaluations have left in `folder`.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_staged(folder: &Path) -> Result<()> {
    for entry in entries_or_none(folder)? {
        if is_staged(&entry) && is_folder(&entry) {
            remove(&entry)?;
        }
    }
    Ok(())
}

/// Whether a name is one that [`StagedFolder::new`] gives.
fn is_staged(path: &Path) -> bool {
    let inner = name_of(path).and_then(|name| name.strip_prefix('.')?.strip_suffix(STAGED));
    inner.and_then(step_of_name).is_some()
}

/// Name of the folder with the evaluation after `step`.
pub fn name_of_step(step: u32) -> String {
    format!("{step:06}")
}

/// The step that [`name_of_step`] made a name of.
pub fn step_of_name(name: &str) -> Option<u32> {
    name.parse().ok().filter(|step| name_of_step(*step) == name)
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

/// Deletes a folder that is empty; links stay.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_if_empty(folder: &Path) -> Result<()> {
    if is_folder(folder) && entries(folder)?.is_empty() {
        fs::remove_dir(folder).map_err(|e| Error::io(folder, e))?;
    }
    Ok(())
}

/// Whether a path is a folder itself, not a link to one.
pub fn is_folder(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|facts| facts.is_dir())
}

/// Deletes a file or a link, if it exists. Folders, devices and pipes stay: whoever made them, it was no run.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_file(path: &Path) -> Result<()> {
    match fs::symlink_metadata(path) {
        Ok(facts) if facts.is_file() || facts.is_symlink() => {
            fs::remove_file(path).map_err(|e| Error::io(path, e))
        }
        _ => Ok(()),
    }
}

/// Deletes a file or a folder with all its contents, if it exists.
///
/// # Errors
/// [`Error::Io`].
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

    /// A table of one view, `a.jpg`; the second figure tells tables apart.
    fn table(figure: &str) -> String {
        format!(
            "name,psnr,grad_psnr,ssim_3dgs,ssim_valid,flip,psnr_corrected,uncovered\na.jpg,{figure},1,1,1,1,,\n"
        )
    }

    fn publish(target: &Path, figure: &str) {
        let staged = StagedFolder::new(target.to_owned()).unwrap();
        fs::create_dir(staged.path().join("error")).unwrap();
        for name in ["a.png", "error/a.png"] {
            fs::write(staged.path().join(name), figure).unwrap();
        }
        fs::write(staged.path().join(PER_VIEW), table(figure)).unwrap();
        assert_eq!(staged.publish().unwrap(), target);
    }

    #[test]
    fn evaluations_are_published_atomically_and_keep_other_files() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("eval/000300");
        let staged = StagedFolder::new(target.clone()).unwrap();
        fs::write(staged.path().join("a.png"), "x").unwrap();
        drop(staged);
        assert!(entries(&dir.path().join("eval")).unwrap().is_empty());
        let mine = ["notes.txt", "comparison.png", "error/comparison.png", "b.csv"].map(|n| target.join(n));
        for figure in ["1", "2"] {
            publish(&target, figure);
            mine.iter().for_each(|file| fs::write(file, "mine").unwrap());
        }
        assert_eq!(fs::read_to_string(target.join("error/a.png")).unwrap(), "2");
        remove_evaluation(&target, false).unwrap();
        assert!(!target.join("a.png").exists() && target.join(PER_VIEW).exists());
        remove_evaluation(&target, true).unwrap();
        assert!(!target.join(PER_VIEW).exists() && mine.iter().all(|file| file.exists()));
        assert_eq!(entries(&dir.path().join("eval")).unwrap().len(), 1, "nothing staged is left");
        // Without other files the folder goes too.
        let target = dir.path().join("eval/000400");
        publish(&target, "1");
        remove_evaluation(&target, true).unwrap();
        assert!(!target.exists());
    }

    #[test]
    fn a_folder_with_the_table_of_someone_else_stays_whole() {
        let dir = tempfile::tempdir().unwrap();
        for text in [None, Some("name,psnr\na.jpg,1\n")] {
            fs::write(dir.path().join("a.png"), "mine").unwrap();
            if let Some(text) = text {
                fs::write(dir.path().join(PER_VIEW), text).unwrap();
            }
            remove_evaluation(dir.path(), true).unwrap();
            assert!(dir.path().join("a.png").exists(), "{text:?}");
        }
    }

    #[test]
    fn only_leftovers_of_evaluations_are_deleted() {
        let dir = tempfile::tempdir().unwrap();
        for name in [".000300.part", ".1000000.part", ".thesis.part", ".0003000.part", "000300.part"] {
            fs::create_dir(dir.path().join(name)).unwrap();
        }
        fs::write(dir.path().join(".000400.part"), "mine").unwrap();
        remove_staged(dir.path()).unwrap();
        let mut left = entries(dir.path()).unwrap();
        left.sort();
        let names: Vec<_> = left.iter().filter_map(|path| name_of(path)).collect();
        assert_eq!(names, [".0003000.part", ".000400.part", ".thesis.part", "000300.part"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_to_folders_of_others_are_not_followed() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let (photos, target) = (dir.path().join("photos"), dir.path().join("000300"));
        fs::create_dir(&photos).unwrap();
        let mine = [("a.png", "mine".to_owned()), (PER_VIEW, table("9"))];
        mine.iter().for_each(|(name, text)| fs::write(photos.join(name), text).unwrap());
        let is_whole =
            || mine.iter().all(|(name, text)| fs::read_to_string(photos.join(name)).unwrap() == *text);
        symlink(&photos, &target).unwrap();
        remove_evaluation(&target, true).unwrap();
        assert!(is_whole() && target.is_symlink());
        // A new evaluation takes the place of the link.
        publish(&target, "1");
        assert!(is_whole() && is_folder(&target));
        // The same further in.
        fs::remove_dir_all(target.join("error")).unwrap();
        symlink(&photos, target.join("error")).unwrap();
        remove_evaluation(&target, false).unwrap();
        assert!(is_whole() && !target.join("a.png").exists());
        publish(&target, "2");
        assert!(is_whole() && is_folder(&target.join("error")));
    }
}
