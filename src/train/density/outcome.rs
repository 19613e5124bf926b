//! What became of the splats that grew in the last density-control step, and of those that were withheld (method 6.14).

use super::growth::KINDS;
use super::history::{SplatHistory, Trial};
use super::score::Scores;

/// Losses of a group of splats over a window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Number of splats; a half counts as one.
    pub splats: f64,
    /// Their summed loss before the step.
    pub before: f64,
    /// Their summed loss after the window.
    pub after: f64,
}

impl Outcome {
    /// The share of the loss that is left; `None` if there was none, or none is left.
    pub fn left(&self) -> Option<f64> {
        (self.before > 0.0 && self.after > 0.0).then(|| self.after / self.before)
    }

    /// Two groups taken together.
    pub fn and(self, other: Self) -> Self {
        Self {
            splats: self.splats + other.splats,
            before: self.before + other.before,
            after: self.after + other.after,
        }
    }

    /// This outcome with less weight.
    pub fn faded(self, weight: f64) -> Self {
        Self { splats: weight * self.splats, before: weight * self.before, after: weight * self.after }
    }
}

/// Outcomes of a window by kind of growth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcomes {
    /// Splats that grew.
    pub grown: [Outcome; KINDS],
    /// Splats that were withheld from growth of this kind.
    pub withheld: [Outcome; KINDS],
}

impl Outcomes {
    /// Compares the losses of a window with those before it. Splats whose loss was unknown are left out.
    pub fn new(histories: &[SplatHistory], scores: &Scores) -> Self {
        let mut all = Self::default();
        for (history, &after) in
            histories.iter().zip(&scores.total).filter(|(history, _)| history.error > 0.0)
        {
            let group = match (history.trial, history.trial.grown()) {
                (Trial::Withheld(kind), _) => &mut all.withheld[kind as usize],
                (_, Some(kind)) => &mut all.grown[kind as usize],
                _ => continue,
            };
            *group = group.and(Outcome { splats: 1.0, before: history.error.into(), after });
        }
        all
    }
}
