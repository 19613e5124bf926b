//! Warnings with counts, collected while results are read and compared.

/// A kind of warning and how often it occurred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Stable identifier in kebab-case, such as `noisy-runs`.
    pub code: String,
    /// A sentence that names what was found and the first case.
    pub message: String,
    /// Number of occurrences.
    pub count: usize,
}

/// Warnings in the order in which their kinds first occurred.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// One entry per code.
    pub warnings: Vec<Warning>,
}

impl Report {
    /// Records `count` occurrences; a second call with the same code adds to the first.
    pub fn warn(&mut self, code: &str, count: usize, message: impl Into<String>) {
        match self.warnings.iter_mut().find(|w| w.code == code) {
            Some(known) => known.count += count,
            None => self.warnings.push(Warning { code: code.to_owned(), message: message.into(), count }),
        }
    }
}
