//! Checks SPZ files for problems. The rules are those of `plain.rs`.

use super::read::decode_spz;
use crate::fallback::plain::{Check, Raw, unreadable};
use crate::{Issue, ReadLimits, Severity};
use std::path::Path;

/// Checks the bytes of a file by any program; `path` is only for messages.
pub fn validate(bytes: &[u8], path: &Path) -> Vec<Issue> {
    let contents = match decode_spz(bytes, path, &ReadLimits::default()) {
        Ok(contents) => contents,
        Err(error) => return vec![unreadable(&error)],
    };
    let mut issues = Vec::new();
    for warning in &contents.warnings {
        let (code, severity, place) = if warning.contains("metadata") {
            ("LT4010", Severity::Warning, "extension record")
        } else if warning.contains("extension record") || warning.contains("unknown extension") {
            ("LT4012", Severity::Warning, "extension record")
        } else if warning.contains("broken") {
            ("LT4002", Severity::Error, "")
        } else {
            ("LT4008", Severity::Info, "")
        };
        issues.push(Issue::new(code, severity, place, warning));
    }
    let (asset, mut check) = (&contents.asset, Check::default());
    for i in 0..asset.num_splats() {
        check.add(&Raw {
            position: asset.positions[i].map(f64::from),
            norm: 1.0,
            scales: asset.scales[i].map(f64::from),
            opacity: asset.opacities[i].into(),
            is_finite: true,
            is_thick: false,
        });
    }
    issues.extend(check.issues());
    issues
}
