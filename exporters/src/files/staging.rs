//! Stages files so that they can be verified before any older one is touched. They have their final names in a staging
//! folder `.NAME.PID-N.part` next to their destination, so that references between them hold; publishing renames them.
//!
//! Sidecar files keep their names from one export to the next, because other programs know them by name. They are renamed
//! one after the other, and the file that refers to them last. A process that is killed in between leaves files of two
//! exports, which readers refuse by the hashes of [`crate::files::sidecars`]; a new export puts that right.

use crate::files::atomic_file::{move_to, temporary_beside};
use crate::{Error, Result, Written, text};
use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

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
}

impl Staged {
    /// Writes the files of the asset at `path` into a fresh folder next to it.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Invalid`] if `path` is not the name of a file.
    pub(crate) fn new(path: &Path, root: Vec<u8>, side: Vec<SidecarFile>) -> Result<Self> {
        let name = path.file_name().ok_or_else(|| Error::invalid(path, "not the name of a file"))?;
        if !side.is_empty() && name.to_str().is_none() {
            return Err(Error::invalid(path, "the file's name must be UTF-8: sidecar files share it"));
        }
        let mut staged = Self {
            folder: fresh_folder(path)?,
            place: path.parent().unwrap_or(Path::new("")).to_owned(),
            names: Vec::new(),
            written: Written::default(),
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
        let file = self.folder.join(name);
        let folder = file.parent().unwrap_or(&self.folder);
        let written = fs::create_dir_all(folder).and_then(|()| fs::write(&file, bytes));
        written.map_err(|e| Error::io(self.place.join(name), e))?;
        self.names.push(name.to_owned());
        self.written.files.push(self.place.join(name));
        self.written.sizes.push(bytes.len() as u64);
        Ok(())
    }

    pub(crate) fn add_notes(&mut self, notes: impl IntoIterator<Item = String>) {
        self.written.notes.extend(notes);
    }

    /// Where the asset can be read until it is published. Errors of readers name this path: see [`Error::at`].
    pub fn path(&self) -> PathBuf {
        self.folder.join(self.names.last().map_or(Path::new(""), PathBuf::as_path))
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
    /// if `overwrites`; nothing is touched if one of them cannot be. A link is replaced, its target is not touched; a link to
    /// a folder serves as the folder.
    ///
    /// # Errors
    /// [`Error::Io`]: of the kind [`ErrorKind::AlreadyExists`] for the first file that would have to be replaced but may
    /// not; [`ErrorKind::IsADirectory`] for a folder in the way of a file, [`ErrorKind::NotADirectory`] for a file in the
    /// way of a folder.
    pub fn publish(mut self, overwrites: bool) -> Result<Written> {
        for name in &self.names {
            self.check_folder(name)?;
            self.check_file(name, overwrites)?;
        }
        self.names.iter().try_for_each(|name| self.put(name))?;
        Ok(std::mem::take(&mut self.written))
    }

    /// Moves a file to its place.
    fn put(&self, name: &Path) -> Result<()> {
        let file = self.place.join(name);
        let folder = file.parent().filter(|_| name.components().count() > 1);
        folder
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| move_to(&file, &self.folder.join(name)))
            .map_err(|e| Error::io(file, e))
    }

    /// An error if a file is in the place of the folder of a file.
    fn check_folder(&self, name: &Path) -> Result<()> {
        let Some(name) = name.parent().filter(|f| !f.as_os_str().is_empty()) else { return Ok(()) };
        let folder = self.place.join(name);
        match fs::metadata(&folder) {
            Ok(facts) if !facts.is_dir() => {
                let what = "a file is in the place of a folder for";
                Err(self.in_the_way(&folder, ErrorKind::NotADirectory, what))
            }
            Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(folder, e)),
            Ok(_) | Err(_) => Ok(()),
        }
    }

    /// An error if something is in the place of a file that may not be replaced.
    fn check_file(&self, name: &Path, overwrites: bool) -> Result<()> {
        let file = self.place.join(name);
        let facts = match fs::symlink_metadata(&file) {
            Ok(facts) => facts,
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(()),
            Err(e) => return Err(Error::io(file, e)),
        };
        let (kind, what) = match () {
            // Also where a link leads to one.
            () if file.is_dir() => (ErrorKind::IsADirectory, "a folder is in the place of a file of"),
            () if !facts.is_file() && !facts.is_symlink() => {
                (ErrorKind::InvalidInput, "something that is not a regular file is in the place of a file of")
            }
            () if !overwrites => (ErrorKind::AlreadyExists, "a file is already in the place of one of"),
            () => return Ok(()),
        };
        Err(self.in_the_way(&file, kind, what))
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
        // What cannot be removed now cannot be removed later.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Makes a folder next to a file, on the same file system: moving out of it is one step.
fn fresh_folder(path: &Path) -> Result<PathBuf> {
    loop {
        let folder = temporary_beside(path);
        match fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            // Left behind by a process of this number that was killed.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            Err(e) => return Err(Error::io(path, e)),
        }
    }
}

#[cfg(test)]
mod tests;
