//! Files that are written and can be proven before any older one is touched. They stand under their final names in a
//! temporary folder beside their place, so that they refer to each other as they will; publishing renames them.
//! What the files hold is decided elsewhere.

use crate::file::temporary_name;
use crate::{Error, Result, Written};
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A file beside the one that names it: its name relative to the folder of that, `/` between parts, and its bytes.
pub(crate) type SideFile = (OsString, Vec<u8>);

/// An asset that is written, but not yet at its place. Dropped without [`Staged::publish`], nothing of it stays.
#[derive(Debug)]
pub struct Staged {
    /// The temporary folder: new files are in `new`, replaced ones for a moment in `old`.
    folder: PathBuf,
    /// Folder of the final files.
    place: PathBuf,
    /// Names relative to the folder; the file that names the others is the last.
    names: Vec<PathBuf>,
    written: Written,
    /// Set where an old file lies there that could not be put back.
    keeps_folder: bool,
}

impl Staged {
    /// Writes the files of the asset at `path` into a fresh folder beside it.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Invalid`] if `path` is not the name of a file.
    pub(crate) fn new(path: &Path, root: Vec<u8>, side: Vec<SideFile>) -> Result<Self> {
        let name = path.file_name().ok_or_else(|| Error::invalid(path, "not the name of a file"))?;
        let place = path.parent().unwrap_or(Path::new("")).to_owned();
        let mut staged = Self {
            folder: fresh_folder(path)?,
            place,
            names: Vec::new(),
            written: Written { files: vec![path.to_owned()], ..Written::default() },
            keeps_folder: false,
        };
        for (name, bytes) in &side {
            staged.write(Path::new(name), bytes)?;
            staged.written.files.push(staged.place.join(name));
        }
        staged.write(Path::new(name), &root)?;
        Ok(staged)
    }

    /// Writes a file and takes note of it.
    fn write(&mut self, name: &Path, bytes: &[u8]) -> Result<()> {
        let file = self.new_file(name);
        let folder = file.parent().unwrap_or(&self.folder);
        let written = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&file, bytes));
        written.map_err(|e| Error::io(self.place.join(name), e))?;
        self.names.push(name.to_owned());
        self.written.bytes += bytes.len() as u64;
        Ok(())
    }

    fn new_file(&self, name: &Path) -> PathBuf {
        self.folder.join("new").join(name)
    }

    pub(crate) fn add_notes(&mut self, notes: impl IntoIterator<Item = String>) {
        self.written.notes.extend(notes);
    }

    /// Where the asset can be read until it is published. Errors of readers name this path: see [`Error::at`].
    pub fn path(&self) -> PathBuf {
        self.new_file(self.names.last().map_or(Path::new(""), PathBuf::as_path))
    }

    /// Where the files will be, the one that was asked for first.
    pub fn files(&self) -> &[PathBuf] {
        &self.written.files
    }

    /// What was written, under final names.
    pub fn written(&self) -> &Written {
        &self.written
    }

    /// Puts the files at their places, the one that names the others last. Files that are there already are replaced,
    /// if `overwrites`; if anything fails, they are put back and nothing new stays. A link is replaced, what it leads to
    /// stays as it is; a link to a folder serves as the folder.
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
        let mut done = Vec::new();
        let put = self.names.iter().try_for_each(|name| self.put(name, overwrites, &mut done));
        match put {
            Ok(()) => Ok(std::mem::take(&mut self.written)),
            Err(error) => Err(self.undone(done, error)),
        }
    }

    /// The folder of a file, if the asset brings one, and whether it is there.
    fn check_folder(&self, name: &Path) -> Result<Option<(PathBuf, bool)>> {
        let Some(folder) = name.parent().filter(|f| !f.as_os_str().is_empty()) else { return Ok(None) };
        let folder = self.place.join(folder);
        match std::fs::metadata(&folder) {
            Ok(facts) if facts.is_dir() => Ok(Some((folder, true))),
            Ok(_) => Err(self.in_the_way(&folder, ErrorKind::NotADirectory, "a file is where a folder of")),
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(Some((folder, false))),
            Err(e) => Err(Error::io(folder, e)),
        }
    }

    /// Whether a file is there; that it may be replaced if so.
    fn check_file(&self, name: &Path, overwrites: bool) -> Result<bool> {
        let file = self.place.join(name);
        let facts = match std::fs::symlink_metadata(&file) {
            Ok(facts) => facts,
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(false),
            Err(e) => return Err(Error::io(file, e)),
        };
        match () {
            // Also where a link leads to one.
            () if file.is_dir() => {
                Err(self.in_the_way(&file, ErrorKind::IsADirectory, "a folder is where a file of"))
            }
            () if !facts.is_file() && !facts.is_symlink() => {
                Err(self.in_the_way(&file, ErrorKind::InvalidInput, "no regular file is where a file of"))
            }
            () if !overwrites => {
                Err(self.in_the_way(&file, ErrorKind::AlreadyExists, "exists already where a file of"))
            }
            () => Ok(true),
        }
    }

    fn in_the_way(&self, file: &Path, kind: ErrorKind, what: &str) -> Error {
        let root = self.written.files.first().map(|f| f.display().to_string()).unwrap_or_default();
        let hint = match kind {
            ErrorKind::AlreadyExists => "allow that it is replaced, or choose another name",
            _ => "remove it or choose another name",
        };
        Error::io(file, std::io::Error::new(kind, format!("{what} {root} would be: {hint}")))
    }

    /// Puts one file at its place. What must be undone if a later one fails is added to `done`.
    fn put(&self, name: &Path, overwrites: bool, done: &mut Vec<Done>) -> Result<()> {
        if let Some((folder, false)) = self.check_folder(name)? {
            std::fs::create_dir(&folder).map_err(|e| Error::io(&folder, e))?;
            done.push(Done::Folder(folder));
        }
        let file = self.place.join(name);
        let failed = |e| Error::io(&file, e);
        let is_last = self.names.last().is_some_and(|last| last == name);
        // The last one needs no way back and is replaced in one step: there is no moment without it.
        if self.check_file(name, overwrites)? && !is_last {
            let old = self.folder.join("old");
            std::fs::create_dir_all(&old).map_err(failed)?;
            let kept = old.join(done.len().to_string());
            std::fs::rename(&file, &kept).map_err(failed)?;
            done.push(Done::Old { kept, file: file.clone() });
        }
        std::fs::rename(self.new_file(name), &file).map_err(failed)?;
        done.push(Done::New(file));
        Ok(())
    }

    /// Goes back, and adds to the error what could not be undone.
    fn undone(&mut self, done: Vec<Done>, error: Error) -> Error {
        let mut lost = Vec::new();
        for step in done.into_iter().rev() {
            match step {
                // The first error is the one that matters.
                Done::New(file) => drop(std::fs::remove_file(file)),
                Done::Folder(folder) => drop(std::fs::remove_dir(folder)),
                Done::Old { kept, file } => {
                    if std::fs::rename(&kept, &file).is_err() {
                        lost.push(format!("{} is now {}", file.display(), kept.display()));
                    }
                }
            }
        }
        if lost.is_empty() {
            return error;
        }
        self.keeps_folder = true;
        let path = self.written.files.first().cloned().unwrap_or_default();
        let what = format!("{error}; old files could not be put back: {}", lost.join(", "));
        Error::io(path, std::io::Error::other(what))
    }
}

/// A step of publishing.
enum Done {
    /// A folder was made.
    Folder(PathBuf),
    /// A file was moved aside.
    Old { kept: PathBuf, file: PathBuf },
    /// A file was put at its place.
    New(PathBuf),
}

impl Drop for Staged {
    fn drop(&mut self) {
        if !self.keeps_folder {
            // What cannot be removed now cannot be removed later.
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }
}

/// Makes a folder beside a file, on the same file system: renaming out of it is one step.
fn fresh_folder(path: &Path) -> Result<PathBuf> {
    loop {
        let folder = temporary_name(path);
        match std::fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            // Left behind by a process of this number that was killed.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            Err(e) => return Err(Error::io(path, e)),
        }
    }
}

#[cfg(test)]
mod tests;
