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
    /// `None` if there is no such file; links are followed.
    pub fn of(path: PathBuf) -> Option<Self> {
        Self::from_facts(std::fs::metadata(&path), path)
    }

    /// `None` if there is no such file in its folder: a link could lead to one elsewhere.
    pub fn of_own(path: PathBuf) -> Option<Self> {
        Self::from_facts(std::fs::symlink_metadata(&path), path)
    }

    fn from_facts(facts: std::io::Result<std::fs::Metadata>, path: PathBuf) -> Option<Self> {
        let facts = facts.ok().filter(std::fs::Metadata::is_file)?;
        Some(Self { changed: facts.modified().ok()?, bytes: facts.len(), path })
    }
}
