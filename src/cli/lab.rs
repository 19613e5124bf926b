//! Converts the errors and warnings of `litetex-lab`, which does not depend on this crate, to this crate's types.

use litetex_gs::{Error, Report};

/// The same error in our family of errors, and so with our exit codes.
pub fn error(error: litetex_lab::Error) -> Error {
    match error {
        litetex_lab::Error::InvalidInput { path, what } => Error::invalid(path, what),
        litetex_lab::Error::Io { path, cause } => Error::io(path, cause),
        other => Error::Usage(other.to_string()),
    }
}

/// The same warnings as our report.
pub fn report(report: litetex_lab::Report) -> Report {
    let mut ours = Report::default();
    for warning in report.warnings {
        ours.warn(&warning.code, warning.count, warning.message);
    }
    ours
}
