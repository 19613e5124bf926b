//! What can go wrong with a file or an asset.

use crate::text;
use std::path::{Path, PathBuf};

/// An [`Error::Invalid`] with a message as of [`format!`]: `invalid!(path, "{found}, expected {expected}")`.
macro_rules! invalid {
    ($path:expr, $($what:tt)+) => { $crate::Error::invalid($path, format!($($what)+)) };
}

/// An [`Error::Unsupported`] with a message as of [`format!`]: `unsupported!(path, "{found}, expected {expected}")`.
macro_rules! unsupported {
    ($path:expr, $($what:tt)+) => { $crate::Error::unsupported($path, format!($($what)+)) };
}

/// An [`Error::TooLarge`] with a message as of [`format!`]: `too_large!(path, "{found}, expected {expected}")`.
macro_rules! too_large {
    ($path:expr, $($what:tt)+) => { $crate::Error::too_large($path, format!($($what)+)) };
}

/// Result with this crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What went wrong, by family.
///
/// Messages are short and free of control characters, whatever the file holds: make errors with the functions below.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Reading or writing failed.
    #[error("{}: {source}", text::path(path))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A file, or the asset to be written there, breaks a rule.
    #[error("{}: {what}", text::path(path))]
    Invalid {
        /// The file that breaks it, or would.
        path: PathBuf,
        /// The element, what was found and what was expected.
        what: String,
    },
    /// A file is valid, but this crate cannot use it.
    #[error("{}: {what}", text::path(path))]
    Unsupported {
        /// The file that is not supported.
        path: PathBuf,
        /// What is not supported and what is.
        what: String,
    },
    /// Something stands where a file is to be written, and is not replaced.
    #[error("{}: {what}", text::path(path))]
    Occupied {
        /// Where the file was to be.
        path: PathBuf,
        /// What stands there and what to do.
        what: String,
    },
    /// A file or an asset exceeds a limit.
    #[error("{}: {what}", text::path(path))]
    TooLarge {
        /// The file that exceeds it, or would.
        path: PathBuf,
        /// The quantity, its value and its limit.
        what: String,
    },
}

impl Error {
    /// Makes an [`Error::Io`].
    pub fn io(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }

    /// Makes an [`Error::Invalid`].
    pub fn invalid(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::Invalid { path: path.into(), what: text::message(what.into()) }
    }

    /// Makes an [`Error::Unsupported`].
    pub fn unsupported(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.into(), what: text::message(what.into()) }
    }

    /// Makes an [`Error::TooLarge`].
    pub fn too_large(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::TooLarge { path: path.into(), what: text::message(what.into()) }
    }

    /// The message without the path, for where the path is known. Errors of the operating system keep theirs: they are
    /// mostly about a sidecar file.
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Io { .. } => self.to_string(),
            Self::Invalid { what, .. }
            | Self::Unsupported { what, .. }
            | Self::Occupied { what, .. }
            | Self::TooLarge { what, .. } => what.clone(),
        }
    }

    /// The same error, its message prefixed with the part of the file that it is about.
    pub(crate) fn within(self, part: &str) -> Self {
        match self {
            Self::Io { .. } | Self::Occupied { .. } => self,
            Self::Invalid { path, what } => Self::invalid(path, format!("{part}: {what}")),
            Self::Unsupported { path, what } => Self::unsupported(path, format!("{part}: {what}")),
            Self::TooLarge { path, what } => Self::too_large(path, format!("{part}: {what}")),
        }
    }

    /// An error about a sidecar file of `path`, naming both: without the sidecar file, the one that refers to it is
    /// incomplete.
    pub(crate) fn named_by(self, path: &Path) -> Self {
        let by = text::path(path);
        match self {
            Self::Io { path: side, source } => {
                let what = format!("{source} (named by {by})");
                Self::io(side, std::io::Error::new(source.kind(), what))
            }
            Self::TooLarge { path: side, what } if side != path => {
                Self::too_large(side, format!("{what} (named by {by})"))
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
            | Self::Occupied { path: p, .. }
            | Self::TooLarge { path: p, .. } => *p = path.to_owned(),
        }
        self
    }
}
