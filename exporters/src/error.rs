//! What can go wrong with a file or an asset.

use std::path::{Path, PathBuf};

/// Result with this crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What went wrong, by family.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's word.
        source: std::io::Error,
    },
    /// A file, or the asset to be written there, breaks a rule.
    #[error("{}: {what}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Element, what was found and what was expected.
        what: String,
    },
    /// A file is sound, but this crate cannot use it.
    #[error("{}: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What is not supported and what is.
        what: String,
    },
    /// A file or an asset exceeds a limit.
    #[error("{}: {what}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The quantity, its value and its limit.
        what: String,
    },
}

impl Error {
    /// An [`Error::Io`].
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }

    /// An [`Error::Invalid`].
    pub fn invalid(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::Invalid { path: path.into(), what: what.into() }
    }

    /// An [`Error::Unsupported`].
    pub fn unsupported(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.into(), what: what.into() }
    }

    /// An [`Error::TooLarge`].
    pub fn too_large(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::TooLarge { path: path.into(), what: what.into() }
    }

    /// The error about a file beside `path`, told of both: without a side file, the file that names it is not whole.
    pub(crate) fn named_by(self, path: &Path) -> Self {
        match self {
            Self::Io { path: side, source } => {
                let what = format!("{source} (named by {})", path.display());
                Self::io(side, std::io::Error::new(source.kind(), what))
            }
            Self::TooLarge { path: side, what } if side != path => {
                Self::too_large(side, format!("{what} (named by {})", path.display()))
            }
            other => other,
        }
    }

    /// The same error about the file at `path`: for what was found before the file was known.
    pub fn at(mut self, path: &Path) -> Self {
        match &mut self {
            Self::Io { path: p, .. }
            | Self::Invalid { path: p, .. }
            | Self::Unsupported { path: p, .. }
            | Self::TooLarge { path: p, .. } => *p = path.to_owned(),
        }
        self
    }
}
