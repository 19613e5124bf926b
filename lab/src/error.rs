//! The crate's error type.

use std::path::PathBuf;

/// Result with the crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong with a matrix or with results.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Settings that contradict each other or the results.
    #[error("{0}")]
    Usage(String),
    /// A file has invalid contents.
    #[error("{}: {what}", path.display())]
    InvalidInput {
        /// The offending file.
        path: PathBuf,
        /// What was found, what was expected and what to do.
        what: String,
    },
    /// Reading or writing failed.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file that was read or written.
        path: PathBuf,
        /// The system's error. Already part of the message and so not its `source`.
        cause: std::io::Error,
    },
}

impl Error {
    pub(crate) fn invalid(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::InvalidInput { path: path.into(), what: what.into() }
    }

    pub(crate) fn io(path: impl Into<PathBuf>, cause: std::io::Error) -> Self {
        Self::Io { path: path.into(), cause }
    }
}
