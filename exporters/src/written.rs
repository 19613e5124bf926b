//! What writing an asset leaves.

use std::path::PathBuf;

/// The files that an asset was written to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Written {
    /// All files; first the one requested.
    pub files: Vec<PathBuf>,
    /// Their size together.
    pub bytes: u64,
    /// What users should know about the result.
    pub notes: Vec<String>,
}
