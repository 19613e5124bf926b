//! Whether photos are good enough to be trained on, said before anyone trains: what `litetex inspect` ends with.
//!
//! `measure` takes figures of a capture, from its cameras and points and from at most 60 decoded photos; `judge` makes the
//! verdict of them.

mod blur;
mod exposure;
mod geometry;
mod judge;
mod measure;
mod same_points;
mod sharpness;

#[cfg(test)]
mod tests;

pub use measure::Figures;

use super::loaded::Capture;
use serde::Serialize;

/// What a capture is good for. From good to bad.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rating {
    /// Train it.
    Good,
    /// Train it, and expect parts of it to stay vague or blurred.
    Usable,
    /// Take other photos first.
    ShootAgain,
}

impl Rating {
    /// As people read it.
    pub fn words(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Usable => "usable",
            Self::ShootAgain => "shoot again",
        }
    }
}

/// One thing that is wrong with a capture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// Stable identifier, kebab-case ("few-views").
    pub code: &'static str,
    /// The best that a capture with it can be.
    pub rating: Rating,
    /// What was found.
    pub found: String,
    /// What to do.
    pub remedy: &'static str,
}

/// The verdict on a capture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// That of the worst reason.
    pub rating: Rating,
    /// At most three, the worst first.
    pub reasons: Vec<Reason>,
    /// What they follow from.
    pub figures: Figures,
}

impl Capture {
    /// Says what the capture is good for; decodes at most 60 of its photos, on all threads. A photo that cannot be decoded is a reason.
    pub fn verdict(&self) -> Verdict {
        let figures = measure::of(self);
        let reasons = judge::reasons(&figures);
        let rating = reasons.first().map_or(Rating::Good, |worst| worst.rating);
        Verdict { rating, reasons, figures }
    }
}
