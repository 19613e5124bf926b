//! The library's error type. Its variants are the families that users need to distinguish, such as invalid input,
//! unsupported input or a failing device. Each has an exit code.

use crate::text;
use std::fmt;
use std::path::{Path, PathBuf};

/// An [`Error::InvalidInput`] with a message as of [`format!`]: `invalid!(path, "{found}, expected {expected}")`.
#[macro_export]
macro_rules! invalid {
    ($path:expr, $($what:tt)+) => { $crate::Error::invalid($path, format!($($what)+)) };
}

/// An [`Error::Unsupported`] with a message as of [`format!`]: `unsupported!(path, "{found}, expected {expected}")`.
#[macro_export]
macro_rules! unsupported {
    ($path:expr, $($what:tt)+) => { $crate::Error::unsupported($path, format!($($what)+)) };
}

/// An [`Error::Usage`] with a message as of [`format!`].
#[macro_export]
macro_rules! usage {
    ($($what:tt)+) => { $crate::Error::Usage(format!($($what)+)) };
}

/// Result with the library's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error, by family. Messages are abridged where files or arguments blow them up to megabytes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder has invalid content.
    #[error("{}: {}", text::path(path), text::message(what))]
    InvalidInput {
        /// The file or folder.
        path: PathBuf,
        /// The element, what was found, what was expected and what to do.
        what: String,
    },
    /// A file is valid, but this program cannot use it.
    #[error("{}: {}", text::path(path), text::message(what))]
    Unsupported {
        /// The file or folder.
        path: PathBuf,
        /// What is unsupported, what is supported instead, and what to do.
        what: String,
    },
    /// Options contradict each other or the data.
    #[error("{}", text::message(.0))]
    Usage(String),
    /// Reading or writing failed.
    #[error("{}: {}", text::path(path), described(cause))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The OS error. It is part of the message and therefore not a `source`, or it would be printed twice.
        cause: std::io::Error,
    },
    /// The device failed or is too small: memory, limits, driver.
    #[error("{}", text::message(.0))]
    Device(String),
    /// The device has no room for what was asked of it. Except where a function says otherwise, it holds what it held before.
    #[error("{}", text::message(&.0.to_string()))]
    DeviceFull(NoRoom),
    /// A check ran and failed.
    #[error("{}", text::message(.0))]
    CheckFailed(String),
    /// Stopped by the user.
    #[error("interrupted")]
    Interrupted,
}

/// What a device has no room for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoRoom {
    /// What, in numbers where they are known.
    pub what: String,
    /// What a run that ends here may try. Warnings of one that goes on name their own remedy.
    pub remedy: Option<&'static str>,
}

impl From<String> for NoRoom {
    fn from(what: String) -> Self {
        Self { what, remedy: None }
    }
}

impl fmt::Display for NoRoom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)?;
        self.remedy.map_or(Ok(()), |remedy| write!(f, "; {remedy}"))
    }
}

impl Error {
    /// An [`Error::InvalidInput`].
    pub fn invalid(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::InvalidInput { path: path.into(), what: what.into() }
    }

    /// An [`Error::Unsupported`].
    pub fn unsupported(path: impl Into<PathBuf>, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.into(), what: what.into() }
    }

    /// An [`Error::Io`].
    pub fn io(path: impl Into<PathBuf>, cause: std::io::Error) -> Self {
        Self::Io { path: path.into(), cause }
    }

    /// Names of the families, as messages and `docs/troubleshooting.md` have them.
    pub const KINDS: [&str; 8] = [
        "check-failed",
        "usage",
        "missing",
        "invalid-input",
        "unsupported",
        "system",
        "device",
        "interrupted",
    ];

    /// The file or folder that it names, if any.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::InvalidInput { path, .. } | Self::Unsupported { path, .. } | Self::Io { path, .. } => {
                Some(path)
            }
            _ => None,
        }
    }

    /// Name of the family.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::CheckFailed(_) => "check-failed",
            Self::Usage(_) => "usage",
            Self::InvalidInput { .. } => "invalid-input",
            Self::Unsupported { .. } => "unsupported",
            Self::Io { cause, .. } if cause.kind() == std::io::ErrorKind::NotFound => "missing",
            Self::Io { .. } => "system",
            Self::Device(_) | Self::DeviceFull(_) => "device",
            Self::Interrupted => "interrupted",
        }
    }

    /// Exit code of the family: 1 check failed, 2 usage, 3 input invalid, 4 unsupported,
    /// 5 device or run time, 130 interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::CheckFailed(_) => 1,
            Self::Usage(_) => 2,
            Self::InvalidInput { .. } => 3,
            Self::Unsupported { .. } => 4,
            // A missing file counts as invalid input, every other refusal of the system as a run-time failure.
            Self::Io { cause, .. } if cause.kind() == std::io::ErrorKind::NotFound => 3,
            Self::Io { .. } | Self::Device(_) | Self::DeviceFull(_) => 5,
            Self::Interrupted => 130,
        }
    }
}

impl From<litetex_exporters::Error> for Error {
    fn from(error: litetex_exporters::Error) -> Self {
        use litetex_exporters::Error as E;
        match error {
            E::Io { path, source } => Self::io(path, source),
            E::Invalid { path, what } => Self::InvalidInput { path, what },
            E::Unsupported { path, what } | E::TooLarge { path, what } => Self::Unsupported { path, what },
            E::Occupied { path, what } => Self::Usage(format!("{}: {what}", path.display())),
            other => Self::CheckFailed(other.to_string()),
        }
    }
}

/// The OS error, with a remedy where one is known.
fn described(cause: &std::io::Error) -> String {
    use std::io::ErrorKind;
    match cause.kind() {
        ErrorKind::NotFound => "no such file or folder; check the path".to_owned(),
        ErrorKind::PermissionDenied => {
            format!("{cause}; check who owns the file or folder and its permissions, or choose another")
        }
        _ => cause.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error as _;
    use std::io::ErrorKind;

    #[test]
    fn a_full_device_names_what_did_not_fit_and_what_to_do() {
        let no_room = NoRoom { what: "gpu: 9 splats, at most 8".into(), remedy: Some("use fewer") };
        assert_eq!(Error::DeviceFull(no_room).to_string(), "gpu: 9 splats, at most 8; use fewer");
        assert_eq!(Error::DeviceFull(String::from("gpu: full").into()).to_string(), "gpu: full");
    }

    #[test]
    fn causes_are_reported_once_with_a_remedy() {
        let missing = Error::io("a/b", ErrorKind::NotFound.into());
        assert_eq!(missing.to_string(), "a/b: no such file or folder; check the path");
        assert_eq!(missing.exit_code(), 3);
        let denied = Error::io("a/b", ErrorKind::PermissionDenied.into());
        assert!(denied.to_string().contains("permissions"), "{denied}");
        let full = Error::io("a/b", std::io::Error::other("disk full"));
        assert_eq!(full.to_string(), "a/b: disk full");
        assert_eq!((denied.exit_code(), full.exit_code()), (5, 5));
        assert!(full.source().is_none());
    }

    #[test]
    fn paths_and_names_of_megabytes_are_abridged() {
        let long = "x".repeat(1 << 20);
        for error in [
            Error::invalid(&long, "a folder"),
            Error::unsupported("a", format!("camera_model {long}; undistort the photos")),
            Error::io(&long, ErrorKind::NotFound.into()),
            Error::Usage(format!("variant {long} occurs twice")),
        ] {
            let text = error.to_string();
            assert!(text.len() < 5000 && text.contains('…'), "{text}");
        }
    }

    #[test]
    fn errors_keep_their_family() {
        let code = |e: litetex_exporters::Error| Error::from(e).exit_code();
        assert_eq!(code(litetex_exporters::Error::invalid("a", "b")), 3);
        assert_eq!(code(litetex_exporters::Error::unsupported("a", "b")), 4);
        assert_eq!(code(litetex_exporters::Error::Occupied { path: "a".into(), what: "b".into() }), 2);
        let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
        assert_eq!(code(litetex_exporters::Error::io("a", missing)), 3);
    }
}
