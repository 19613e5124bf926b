//! Cameras that pose files describe and that are left out on purpose: counted and named.

use crate::Report;
use crate::capture::source::first_names;
use crate::text::counted;

/// Cameras that are no views.
#[derive(Default)]
pub(crate) struct Unused {
    /// Names of those without pose: their photos could not be aligned.
    pub unposed: Vec<String>,
    /// Names of those that the author disabled.
    pub disabled: Vec<String>,
}

impl Unused {
    /// Warns of them.
    pub fn report(&self, report: &mut Report) {
        for (code, names, why) in [
            ("cameras-without-pose", &self.unposed, "without a pose"),
            ("cameras-disabled", &self.disabled, "disabled by the author"),
        ] {
            if !names.is_empty() {
                let first = first_names(names.iter().map(String::as_str));
                let what = format!("left out {} {why}: {first}", counted(names.len(), "camera"));
                report.warn(code, names.len(), what);
            }
        }
    }
}
