//! Cameras that pose files describe and that are left out on purpose: counted and named.

use crate::capture::source::{Source, Why, first_names};
use crate::text::counted;

/// Warns of them.
pub(crate) fn report(source: &mut Source) {
    for (code, why) in [("cameras-without-pose", Why::NoPose), ("cameras-disabled", Why::Disabled)] {
        let names = source.names_unused(why);
        if !names.is_empty() {
            let first = first_names(names.iter().copied());
            let what = format!("left out {} {}: {first}", counted(names.len(), "camera"), why.words());
            let count = names.len();
            source.report.warn(code, count, what);
        }
    }
}
