//! The interface of a pose format: how its files are found and read. The formats are in `formats/`.

use super::folder::CaptureFolder;
use super::source::Source;
use crate::{Report, Result};
use std::path::{Path, PathBuf};

/// An entry in the table of formats.
pub(crate) struct PoseFormat {
    /// As `--format` and `config.toml` call it.
    pub name: &'static str,
    /// One line for `--help`.
    pub help: &'static str,
    /// The files that it looks for, for the message that there are none.
    pub files: &'static str,
    /// Whether it tells which view observes which points, so that the health of the reconstruction can be
    /// measured.
    pub has_observations: bool,
    /// Looks for poses: in a folder, or in the very file that the user named.
    pub find: fn(&Path, &mut Report) -> Option<Found>,
}

/// Poses that were found and not yet read.
pub(crate) struct Found {
    /// The capture's folder, which the paths in the files are relative to.
    pub root: PathBuf,
    /// Files of the poses which lead to the capture around them when the user names one.
    pub files: Vec<PathBuf>,
    /// Reads them.
    pub read: Reader,
}

impl Found {
    /// Poses of a format that finds its capture itself from the very file.
    pub fn new(root: &Path, read: Reader) -> Self {
        Self { root: root.to_owned(), files: Vec::new(), read }
    }
}

/// Reads the poses that were found; what else they name is looked up in the folder.
pub(crate) type Reader = Box<dyn FnOnce(&CaptureFolder) -> Result<Source>>;
