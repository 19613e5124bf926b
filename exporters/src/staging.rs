//! Stages files so that they can be verified before any older one is touched. They have their final names in a staging
//! folder next to their destination, so that references between them hold; publishing moves them.
//!
//! A staging folder is called `.NAME.PID-N.tmp` and holds
//!
//! | entry | what it is |
//! |---|---|
//! | `lock` | locked by the process that made the folder, for as long as it lives |
//! | `new/` | new files until they are moved to their places |
//! | `old/` | replaced files until the last new one is at its place |
//! | `swap.json` | the journal: which files move; exists from before the first move until after the last |
//!
//! Moving several files takes several steps. A process that is killed between two of them leaves the journal, with which
//! the next command that writes or reads the asset finishes the move: see [`repair`].

mod folder;
mod steps;
mod swap;

pub(crate) use folder::{Caller, repair};

use crate::{Error, Result, Written, text};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use steps::Steps;
use swap::{Places, Swap};

/// A sidecar file: its name relative to the folder of the file that refers to it, `/` between parts, and its bytes.
pub(crate) type SidecarFile = (OsString, Vec<u8>);

/// An asset that is written, but not yet at its place. Dropped without [`Staged::publish`], it vanishes.
#[derive(Debug)]
pub struct Staged {
    folder: PathBuf,
    /// Folder of the final files.
    place: PathBuf,
    /// Names relative to it; the file that refers to the others is the last.
    names: Vec<PathBuf>,
    written: Written,
    /// Set where an old file lies in the folder that could not be put back.
    keeps_folder: bool,
    /// Held until the folder is gone.
    _lock: Option<File>,
    steps: Steps,
}

impl Staged {
    /// Writes the files of the asset at `path` into a fresh folder next to it, after tidying up what killed processes left
    /// there.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Invalid`] if `path` is not the name of a file.
    pub(crate) fn new(path: &Path, root: Vec<u8>, side: Vec<SidecarFile>) -> Result<Self> {
        let name = path.file_name().ok_or_else(|| Error::invalid(path, "not the name of a file"))?;
        if !side.is_empty() && name.to_str().is_none() {
            return Err(Error::invalid(path, "the file's name must be UTF-8: sidecar files share it"));
        }
        repair(path, Caller::Writer)?;
        let (folder, lock) = folder::fresh(path)?;
        let mut staged = Self {
            folder,
            place: path.parent().unwrap_or(Path::new("")).to_owned(),
            names: Vec::new(),
            written: Written::default(),
            keeps_folder: false,
            _lock: lock,
            steps: Steps::default(),
        };
        for (name, bytes) in &side {
            staged.write(Path::new(name), bytes)?;
        }
        staged.write(Path::new(name), &root)?;
        // The root is written last and named first, as the caller named it.
        staged.written.files.pop();
        staged.written.files.insert(0, path.to_owned());
        staged.written.sizes.rotate_right(1);
        Ok(staged)
    }

    /// Writes a file and takes note of it.
    fn write(&mut self, name: &Path, bytes: &[u8]) -> Result<()> {
        let file = self.new_file(name);
        let folder = file.parent().unwrap_or(&self.folder);
        let written = fs::create_dir_all(folder).and_then(|()| fs::write(&file, bytes));
        written.map_err(|e| Error::io(self.place.join(name), e))?;
        self.names.push(name.to_owned());
        self.written.files.push(self.place.join(name));
        self.written.sizes.push(bytes.len() as u64);
        Ok(())
    }

    fn places(&self) -> Places<'_> {
        Places { staging: &self.folder, asset: &self.place }
    }

    fn new_file(&self, name: &Path) -> PathBuf {
        self.places().new_file(name)
    }

    pub(crate) fn add_notes(&mut self, notes: impl IntoIterator<Item = String>) {
        self.written.notes.extend(notes);
    }

    /// Where the asset can be read until it is published. Errors of readers name this path: see [`Error::at`].
    pub fn path(&self) -> PathBuf {
        self.new_file(self.names.last().map_or(Path::new(""), PathBuf::as_path))
    }

    /// Where the files will be, the one requested first.
    pub fn files(&self) -> &[PathBuf] {
        &self.written.files
    }

    /// What was written, under final names.
    pub fn written(&self) -> &Written {
        &self.written
    }

    /// Moves the files to their places, the one that refers to the others last. Files that are there already are replaced
    /// if `overwrites`; if anything fails, they are put back and nothing new stays. A link is replaced, its target is not
    /// touched; a link to a folder serves as the folder.
    ///
    /// # Errors
    /// [`Error::Io`]: of the kind [`ErrorKind::AlreadyExists`] for the first file that would have to be replaced but may
    /// not; [`ErrorKind::IsADirectory`] for a folder in the way of a file, [`ErrorKind::NotADirectory`] for a file in the
    /// way of a folder.
    pub fn publish(mut self, overwrites: bool) -> Result<Written> {
        let mut swap = Swap::default();
        for name in &self.names {
            if let Some((folder, false)) = self.check_folder(name)? {
                swap.add_folder(folder);
            }
            swap.add(name, self.check_file(name, overwrites)?);
        }
        let Err(error) = swap.run(self.places(), &self.steps) else {
            return Ok(std::mem::take(&mut self.written));
        };
        let Err(lost) = swap.undo(self.places(), &self.steps) else { return Err(error) };
        self.keeps_folder = true;
        let path = self.written.files.first().cloned().unwrap_or_default();
        let what = format!("{error}; older files could not be put back: {lost}");
        Err(Error::io(path, std::io::Error::other(what)))
    }

    /// The folder of a file, if the asset brings one, and whether it is there.
    fn check_folder<'n>(&self, name: &'n Path) -> Result<Option<(&'n Path, bool)>> {
        let Some(name) = name.parent().filter(|f| !f.as_os_str().is_empty()) else { return Ok(None) };
        let folder = self.place.join(name);
        match fs::metadata(&folder) {
            Ok(facts) if facts.is_dir() => Ok(Some((name, true))),
            Ok(_) => Err(self.in_the_way(
                &folder,
                ErrorKind::NotADirectory,
                "a file is in the place of a folder for",
            )),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(Some((name, false))),
            Err(e) => Err(Error::io(folder, e)),
        }
    }

    /// Whether a file is there; an error if it may not be replaced.
    fn check_file(&self, name: &Path, overwrites: bool) -> Result<bool> {
        let file = self.place.join(name);
        let facts = match fs::symlink_metadata(&file) {
            Ok(facts) => facts,
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(false),
            Err(e) => return Err(Error::io(file, e)),
        };
        match () {
            // Also where a link leads to one.
            () if file.is_dir() => {
                Err(self.in_the_way(&file, ErrorKind::IsADirectory, "a folder is in the place of a file of"))
            }
            () if !facts.is_file() && !facts.is_symlink() => {
                let what = "something that is not a regular file is in the place of a file of";
                Err(self.in_the_way(&file, ErrorKind::InvalidInput, what))
            }
            () if !overwrites => Err(self.in_the_way(
                &file,
                ErrorKind::AlreadyExists,
                "a file is already in the place of one of",
            )),
            () => Ok(true),
        }
    }

    fn in_the_way(&self, file: &Path, kind: ErrorKind, what: &str) -> Error {
        let root = self.written.files.first().map(|f| text::path(f)).unwrap_or_default();
        let hint = match kind {
            ErrorKind::AlreadyExists => "allow replacing it, or choose another name",
            _ => "remove it or choose another name",
        };
        Error::io(file, std::io::Error::new(kind, format!("{what} {root}: {hint}")))
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if !self.keeps_folder {
            folder::remove(&self.folder);
        }
    }
}

#[cfg(test)]
mod tests;
