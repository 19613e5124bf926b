//! The rules by which a density-control step revises a model, one file each; what they share is in `prepare`.

pub mod litetex;
pub mod paper;
pub mod plain;
mod prepare;
mod spec;

use super::policy::Rule;
use super::settings::Budget;
use super::situation::{Revision, Situation};
pub use spec::{RuleSpec, SplitShare};

/// Fewest steps between density-control steps, but at most a thirtieth of the run: an epoch of fewer views would let maps grow
/// more often (method 6.1).
const FEWEST_STEPS: u32 = 35;

impl Rule {
    /// What the trainer must know of the rule, in a run of `steps` with this budget.
    pub fn spec(self, budget: &Budget, steps: u32) -> RuleSpec {
        let fewest = (steps / 30).clamp(1, FEWEST_STEPS);
        match self {
            Self::Litetex => litetex::spec(budget, fewest),
            Self::Paper(_) => paper::spec(fewest),
            Self::Plain => plain::spec(budget),
        }
    }

    /// Decides a density-control step.
    pub fn revise(self, s: &Situation<'_>) -> Revision {
        match self {
            Self::Litetex => litetex::revise(s),
            Self::Paper(variant) => paper::revise(s, &variant),
            Self::Plain => plain::revise(s),
        }
    }
}
