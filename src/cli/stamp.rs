//! Tells whether a file was replaced.

use std::path::PathBuf;
use std::time::SystemTime;

/// The state of a file at a moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stamp {
    pub path: PathBuf,
    pub changed: SystemTime,
    pub bytes: u64,
}

impl Stamp {
    /// `None` if there is no such file.
    pub fn of(path: PathBuf) -> Option<Self> {
        let facts = std::fs::metadata(&path).ok().filter(std::fs::Metadata::is_file)?;
        Some(Self { changed: facts.modified().ok()?, bytes: facts.len(), path })
    }
}
