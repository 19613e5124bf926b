//! The rules by which a density-control step revises a model, one file each; what they share is in `prepare`.

pub mod litetex;
pub mod paper;
pub mod plain;
mod prepare;

use super::policy::Rule;
use super::settings::Budget;
use super::situation::{Revision, Situation};

/// Share of the splats that a step may split where splats of any length are (method 6.6; 3DGS-MCMC: 0.05).
const SPLIT_RATE: f64 = 0.16;

/// Fewest steps between density-control steps, but at most a thirtieth of the run: an epoch of fewer views would let maps grow
/// more often (method 6.1).
const FEWEST_STEPS: u32 = 35;

/// How many splats a step may split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SplitShare {
    /// This share of the splats.
    Fixed(f64),
    /// What the frequency schedule asks for.
    Scheduled,
}

/// What the trainer must know of a rule besides its decisions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuleSpec {
    /// Settings of density control that it does not use, by name.
    pub unused: &'static [&'static str],
    /// Steps of the published timetable between density-control steps.
    pub interval: u32,
    /// Bounds of the steps between density-control steps, which last an epoch where that is within them.
    pub epoch: [u32; 2],
    /// How many splats a step may split.
    pub split_share: SplitShare,
    /// Whether splats of any length are split, or those above [`DensityConfig::split_texels`](super::DensityConfig::split_texels).
    pub splits_any_length: bool,
    /// Whether the user's budget is spent evenly until densification ends.
    pub is_paced: bool,
    /// Whether growth ends by need where that is asked for.
    pub ends_by_need: bool,
    /// Whether maps are cropped and padded between density-control steps.
    pub crops_between: bool,
}

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
