//! Cameras that pose files describe and that cannot be used: counted and named, and refused only if there are many.

use crate::capture::source::first_names;
use crate::text::quoted;
use crate::{Report, Result};
use std::path::Path;

/// More broken cameras than one in this many mean that the file is broken, or not what it seems.
const BROKEN_ONE_IN: usize = 10;

/// Cameras that are left out.
#[derive(Default)]
pub(crate) struct LeftOut {
    /// Names and what is wrong.
    broken: Vec<(String, String)>,
    /// Names of those without pose: their photos could not be aligned.
    unposed: Vec<String>,
    /// Names of those that the author disabled.
    disabled: Vec<String>,
}

impl LeftOut {
    /// A camera whose pose or lens makes no sense.
    pub fn broken(&mut self, name: impl Into<String>, what: impl Into<String>) {
        self.broken.push((name.into(), what.into()));
    }

    /// A camera without pose.
    pub fn unposed(&mut self, name: impl Into<String>) {
        self.unposed.push(name.into());
    }

    /// A camera that the author disabled.
    pub fn disabled(&mut self, name: impl Into<String>) {
        self.disabled.push(name.into());
    }

    /// Warns of what was left out of a file; `num_used` cameras remain.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if more than a tenth of the posed cameras are broken.
    pub fn report(self, path: &Path, num_used: usize, report: &mut Report) -> Result<()> {
        let total = num_used + self.broken.len();
        if let Some((name, what)) = self.broken.first() {
            if self.broken.len() * BROKEN_ONE_IN > total {
                return Err(invalid!(
                    path,
                    "camera {}: {what}; {} of {total} cameras are broken: export them again",
                    quoted(name),
                    self.broken.len()
                ));
            }
            let names = first_names(self.broken.iter().map(|b| b.0.as_str()));
            let count = self.broken.len();
            report.warn(
                "cameras-broken",
                count,
                format!("{count} of {total} cameras are broken and left out: {names} (the first: {what})"),
            );
        }
        for (code, names, what) in [
            ("cameras-without-pose", &self.unposed, "have no pose"),
            ("cameras-disabled", &self.disabled, "are disabled"),
        ] {
            if !names.is_empty() {
                let first = first_names(names.iter().map(String::as_str));
                let what = format!("{} cameras {what} and are left out: {first}", names.len());
                report.warn(code, names.len(), what);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_may_be_broken() {
        let outcome = |broken: usize, num_used| {
            let mut left_out = LeftOut::default();
            (0..broken).for_each(|i| left_out.broken(format!("b{i}"), "zero"));
            left_out.unposed("u");
            let mut report = Report::default();
            left_out.report(Path::new("a.xml"), num_used, &mut report).map(|()| report)
        };
        let report = outcome(1, 9).unwrap();
        assert!(
            report.warnings[0]
                .message
                .contains("1 of 10 cameras are broken and left out: \"b0\" (the first: zero)")
        );
        assert_eq!(report.warnings[1].code, "cameras-without-pose");
        assert!(outcome(2, 9).unwrap_err().to_string().contains("\"b0\": zero; 2 of 11"), "negative control");
        assert_eq!(outcome(0, 2).unwrap().warnings.len(), 1);
    }
}
