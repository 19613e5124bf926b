//! Moves the files of one asset to their places, so that at any moment the move can be finished or undone from what is on
//! the disk.

use super::steps::Steps;
use crate::{Error, Result, text};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf};

/// The journal's name in a staging folder.
pub(super) const JOURNAL: &str = "swap.json";

/// A file of the asset.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Entry {
    /// Relative to the asset's folder.
    name: PathBuf,
    /// Whether an older one was there before the move.
    replaces: bool,
}

/// The files of one asset, the one that refers to the others last, and the folders that the move makes for them.
///
/// Invariant while the journal exists: each file is in `new/` or at its place, and each older one is at its place or in
/// `old/`, but for that of the last file, which is replaced in one step.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Swap {
    files: Vec<Entry>,
    folders: Vec<PathBuf>,
}

/// A staging folder and the folder of the asset.
#[derive(Clone, Copy)]
pub(super) struct Places<'a> {
    pub(super) staging: &'a Path,
    pub(super) asset: &'a Path,
}

impl Places<'_> {
    pub(super) fn new_file(&self, name: &Path) -> PathBuf {
        self.staging.join("new").join(name)
    }

    fn old_file(&self, name: &Path) -> PathBuf {
        self.staging.join("old").join(name)
    }

    fn file(&self, name: &Path) -> PathBuf {
        self.asset.join(name)
    }
}

impl Swap {
    /// Adds the next file.
    pub(super) fn add(&mut self, name: &Path, replaces: bool) {
        self.files.push(Entry { name: name.to_owned(), replaces });
    }

    /// Adds a folder that is not there yet.
    pub(super) fn add_folder(&mut self, name: &Path) {
        if !self.folders.iter().any(|f| f == name) {
            self.folders.push(name.to_owned());
        }
    }

    /// Moves all files. A single file takes one step and needs no journal.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file; what was moved stays.
    pub(super) fn run(&self, places: Places<'_>, steps: &Steps) -> Result<()> {
        if self.files.len() > 1 {
            self.write_journal(places.staging, steps)?;
        }
        self.move_all(places, steps, false)
    }

    /// Moves the files that a killed process has not moved.
    ///
    /// # Errors
    /// As [`Swap::run`].
    pub(super) fn resume(&self, places: Places<'_>, steps: &Steps) -> Result<()> {
        self.move_all(places, steps, true)
    }

    fn move_all(&self, places: Places<'_>, steps: &Steps, is_resumed: bool) -> Result<()> {
        for (i, entry) in self.files.iter().enumerate() {
            if is_resumed && is_missing(&places.new_file(&entry.name)) {
                continue;
            }
            let is_last = i + 1 == self.files.len();
            self.put(entry, is_last, places, steps).map_err(|e| Error::io(places.file(&entry.name), e))?;
        }
        remove_journal(places.staging, steps)
    }

    fn put(&self, entry: &Entry, is_last: bool, places: Places<'_>, steps: &Steps) -> io::Result<()> {
        let (new, file) = (places.new_file(&entry.name), places.file(&entry.name));
        // Before anything is touched.
        fs::symlink_metadata(&new)?;
        let folder = entry.name.parent().filter(|f| self.folders.iter().any(|made| made == f));
        if let Some(folder) = folder.map(|f| places.file(f)).filter(|f| is_missing(f)) {
            steps.run(|| fs::create_dir(folder))?;
        }
        if !is_missing(&file) {
            if !entry.replaces {
                return Err(io::Error::new(
                    ErrorKind::AlreadyExists,
                    "appeared while its asset was being moved",
                ));
            }
            if !is_last {
                let old = places.old_file(&entry.name);
                old.parent().map_or(Ok(()), fs::create_dir_all)?;
                steps.run(|| fs::rename(&file, old))?;
            }
        }
        steps.run(|| fs::rename(new, &file))
    }

    /// Moves new files back and puts older ones where they were.
    ///
    /// # Errors
    /// Says which older files could not be put back; the journal stays.
    pub(super) fn undo(&self, places: Places<'_>, steps: &Steps) -> Result<(), String> {
        let mut lost = Vec::new();
        // The last file is at its place only after all went well.
        for entry in self.files.iter().rev().skip(1) {
            let (new, file) = (places.new_file(&entry.name), places.file(&entry.name));
            let old = places.old_file(&entry.name);
            let is_old_moved = !is_missing(&old);
            if entry.replaces && !is_old_moved {
                continue;
            }
            if is_missing(&new) {
                let _ = steps.run(|| fs::rename(&file, new));
            }
            if is_old_moved && steps.run(|| fs::rename(&old, &file)).is_err() {
                lost.push(format!("{} is now {}", text::path(&file), text::path(&old)));
            }
        }
        for folder in self.folders.iter().rev() {
            let _ = steps.run(|| fs::remove_dir(places.file(folder)));
        }
        if lost.is_empty() && remove_journal(places.staging, steps).is_ok() {
            Ok(())
        } else {
            Err(lost.join(", "))
        }
    }

    fn write_journal(&self, staging: &Path, steps: &Steps) -> Result<()> {
        let journal = staging.join(JOURNAL);
        let failed = |e| Error::io(&journal, e);
        let bytes = serde_json::to_vec(self).map_err(|e| failed(io::Error::other(e)))?;
        // Whole or not there.
        let unfinished = staging.join("swap.tmp");
        fs::write(&unfinished, bytes).map_err(failed)?;
        steps.run(|| fs::rename(unfinished, &journal)).map_err(failed)
    }

    /// The journal of a staging folder; `None` if there is none, or none that a move of ours could have left.
    pub(super) fn from_journal(staging: &Path) -> Option<Self> {
        let bytes = crate::file::read_file(&staging.join(JOURNAL), 1 << 20).ok()?;
        let swap: Self = serde_json::from_slice(&bytes).ok()?;
        let names = swap.files.iter().map(|e| &e.name).chain(&swap.folders);
        let is_plain = |name: &PathBuf| {
            name.components().next().is_some() && name.components().all(|c| matches!(c, Component::Normal(_)))
        };
        // Sidecar files begin with the stem of their asset; nothing else may be touched.
        let stem = swap.files.last()?.name.file_stem()?.to_str()?.to_owned();
        let is_ours = |name: &PathBuf| name.to_str().is_some_and(|n| n.starts_with(&stem)) && is_plain(name);
        names.clone().all(is_ours).then_some(swap)
    }

    /// Whether a file of this name belongs to the asset.
    pub(super) fn contains(&self, name: &Path) -> bool {
        self.files.iter().any(|e| e.name == name)
    }
}

fn remove_journal(staging: &Path, steps: &Steps) -> Result<()> {
    let journal = staging.join(JOURNAL);
    match steps.run(|| fs::remove_file(&journal)) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(journal, e)),
        _ => Ok(()),
    }
}

/// Whether nothing is at a path, not even a link that leads nowhere.
fn is_missing(path: &Path) -> bool {
    fs::symlink_metadata(path).is_err_and(|e| e.kind() == ErrorKind::NotFound)
}
