//! The folder within a capture in which it is made, with a marker for each step that is done.

use crate::{Error, Result, atomic_file};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

/// Its name.
pub const NAME: &str = ".capture-work";

/// What becomes the folder `sparse`.
pub const PUBLISHED: &str = "published";

/// What is left to do of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begun {
    /// Nothing.
    Done,
    /// It was begun with the same inputs and settings.
    Continued,
    /// All, and what an older one left is to be deleted.
    Fresh,
}

/// A work folder, locked until it is dropped.
#[derive(Debug)]
pub struct WorkFolder {
    root: PathBuf,
    _lock: File,
}

impl WorkFolder {
    /// Makes or reopens the work folder of a capture, which may hold nothing else.
    ///
    /// # Errors
    /// [`Error::Usage`] if the capture's folder holds something else or another process works in it; [`Error::Io`].
    pub fn open(capture: &Path) -> Result<Self> {
        Self::check_place(capture)?;
        let root = capture.join(NAME);
        fs::create_dir_all(root.join("logs")).map_err(|e| Error::io(&root, e))?;
        let path = root.join("lock");
        let lock = File::options().write(true).create(true).truncate(false).open(&path);
        let lock = lock.map_err(|e| Error::io(&path, e))?;
        if matches!(lock.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(usage!("{}: another \"litetex capture\" is making this capture", capture.display()));
        }
        Ok(Self { root, _lock: lock })
    }

    /// Refuses what cannot become the folder of a capture, and changes nothing.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is a file or holds something else than an interrupted capture.
    pub fn check_place(capture: &Path) -> Result<()> {
        let root = capture.join(NAME);
        if !root.exists() && fs::read_dir(capture).is_ok_and(|mut entries| entries.next().is_some()) {
            let what =
                if capture.join("sparse/0").exists() { "holds a capture already" } else { "is not empty" };
            return Err(usage!("{}: the folder {what}; choose another", capture.display()));
        }
        if capture.exists() && !capture.is_dir() {
            return Err(usage!("{}: is a file, expected a folder", capture.display()));
        }
        Ok(())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// The log of a step.
    pub fn log(&self, step: &str) -> PathBuf {
        self.root.join("logs").join(format!("{step}.txt"))
    }

    fn marker(&self, step: &str, kind: &str) -> PathBuf {
        self.root.join(format!("{step}.{kind}"))
    }

    /// Begins a step, which `key` describes: its inputs, its settings, and those of the steps before.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn begin(&self, step: &str, key: &str) -> Result<Begun> {
        let is = |kind| fs::read_to_string(self.marker(step, kind)).is_ok_and(|text| text == key);
        if is("done") {
            return Ok(Begun::Done);
        }
        if is("begun") {
            return Ok(Begun::Continued);
        }
        remove(&self.marker(step, "done"))?;
        atomic_file::write(&self.marker(step, "begun"), key.as_bytes())?;
        Ok(Begun::Fresh)
    }

    /// Marks a step that was begun as done.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn end(&self, step: &str) -> Result<()> {
        let begun = self.marker(step, "begun");
        fs::rename(&begun, self.marker(step, "done")).map_err(|e| Error::io(begun, e))
    }

    /// An empty folder.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn fresh_folder(&self, name: &str) -> Result<PathBuf> {
        let folder = self.path(name);
        remove(&folder)?;
        fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        Ok(folder)
    }

    /// Moves the photos and the model to their places and deletes the rest. Whoever is killed in between finds the photos
    /// in place already; the model comes last.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn publish(self, capture: &Path, model: &Path) -> Result<()> {
        let (images, sparse) = (capture.join("images"), capture.join("sparse"));
        let moved = |from: &Path, to: &Path| fs::rename(from, to).map_err(|e| Error::io(to, e));
        if self.path("images").exists() {
            moved(&self.path("images"), &images)?;
        }
        let staged = self.path(PUBLISHED);
        if !staged.join("0").exists() {
            self.fresh_folder(PUBLISHED)?;
            moved(model, &staged.join("0"))?;
        }
        moved(&staged, &sparse)?;
        remove(&self.root)
    }
}

/// Deletes a file or a folder, if there is one.
///
/// # Errors
/// [`Error::Io`].
pub fn remove(path: &Path) -> Result<()> {
    let gone = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    match gone {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(path, e)),
        _ => Ok(()),
    }
}
