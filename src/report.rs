//! Typed warnings with counts, collected during the work and printed once at the end.

use serde::{Deserialize, Serialize};

/// A kind of warning, with the number of its occurrences.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Warning {
    /// Stable identifier, kebab-case ("views-without-photo").
    pub code: String,
    /// One sentence for the user: what, where, and the first few cases.
    pub message: String,
    /// How often it occurred.
    pub count: usize,
}

/// Warnings in the order in which their kinds first occurred.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// At most one entry per code.
    pub warnings: Vec<Warning>,
}

impl Report {
    /// Records `count` occurrences. A later call with the same code adds to the count and keeps the first message.
    pub fn warn(&mut self, code: &str, count: usize, message: impl Into<String>) {
        match self.warnings.iter_mut().find(|w| w.code == code) {
            Some(known) => known.count += count,
            None => self.warnings.push(Warning { code: code.to_owned(), message: message.into(), count }),
        }
    }

    /// Adds all warnings of another report.
    pub fn merge(&mut self, other: Report) {
        for w in other.warnings {
            self.warn(&w.code, w.count, w.message);
        }
    }
}
