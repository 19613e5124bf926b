//! What a density-control step is decided from, and what comes of it.

use super::history::SplatHistory;
use super::settings::{Bound, Budget, Components, DensityConfig};
use super::sizes::MapRule;
use crate::backend::{DensityPlan, WindowStatistics};
use crate::camera::Camera;
use crate::model::Model;
use crate::train::charge::Charge;
use serde::Serialize;
use std::ops::Add;

/// What a revision is decided from.
#[derive(Clone, Copy)]
pub struct Situation<'a> {
    /// The flushed model.
    pub model: &'a Model,
    /// Histories of its splats.
    pub histories: &'a [SplatHistory],
    /// Sums of the statistics window.
    pub statistics: &'a WindowStatistics,
    /// Cameras of the training views, at full size.
    pub cameras: &'a [Camera],
    /// The settings.
    pub settings: &'a DensityConfig,
    /// The parts of the method that are on.
    pub components: Components,
    /// How the sizes of maps are decided.
    pub map_rule: MapRule,
    /// Full image size divided by the current size in training.
    pub render_scale: f64,
    /// Current largest map side, in texels.
    pub texture_cap: u16,
    /// What the timetable allows.
    pub timing: Timing,
    /// What growth is charged for.
    pub charge: Charge,
    /// Bounds of the model after the step.
    pub budget: Budget,
    /// Largest charge of the model after the step.
    pub most_charge: f64,
    /// Number of splats at initialisation.
    pub initial_splats: usize,
    /// Seed of what is random in the step.
    pub seed: u64,
}

impl Situation<'_> {
    /// What the model may grow to.
    pub fn bound(&self) -> Bound {
        Bound { budget: self.budget, charge: self.charge, most_charge: self.most_charge }
    }
}

/// What the timetable allows in a density-control step.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Whether splats and maps may grow.
    pub grows: bool,
    /// Whether the statistics are used. Before the first density-control step and at crop steps they are not:
    /// maps are then only fitted to their support.
    pub use_statistics: bool,
    /// Whether texels have been trained long enough for their values to mean something.
    pub texels_trained: bool,
    /// Whether maps are tested for coarsening, and SH bands tested.
    pub may_coarsen: bool,
    /// Whether maps may be padded and resampled: until a round of pruning has taken off what is not needed.
    pub may_pad: bool,
    /// Highest SH degree that has been trained long enough to be tested; 0: none.
    pub sh_tested: u32,
    /// Checks after which a band that a splat gained is tested.
    pub sh_trial_checks: u16,
    /// Highest SH degree that a splat may have.
    pub sh_highest: u32,
    /// Largest number of splats that may be split.
    pub max_splits: usize,
    /// Length in finest texels above which a splat may be split; `None`: splats of any length.
    pub split_texels: Option<f64>,
    /// Prune count that removes a splat.
    pub patience: u16,
    /// Opacity below which splats fade.
    pub opacity_floor: f64,
}

/// What a revision did, in numbers of splats or maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DensityCounts {
    /// Splats removed because they contributed or covered too little.
    pub pruned: usize,
    /// Splats removed because they were nearly transparent (`plain`: those not respawned).
    pub faded: usize,
    /// Splats replaced by two halves.
    pub split: usize,
    /// Splats split to replace pruned ones.
    pub respawned: usize,
    /// Maps refined to twice the texels along an axis or both, and first maps.
    pub refined: usize,
    /// Maps coarsened, dropped or made smaller to fit their ceiling or the budget.
    pub coarsened: usize,
    /// Splats that lost SH bands.
    pub bands_lost: usize,
    /// Splats that gained an SH band.
    pub bands_gained: usize,
    /// Offers that were not taken for lack of budget.
    pub over_budget: usize,
}

impl Add for DensityCounts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            pruned: self.pruned + other.pruned,
            faded: self.faded + other.faded,
            split: self.split + other.split,
            respawned: self.respawned + other.respawned,
            refined: self.refined + other.refined,
            coarsened: self.coarsened + other.coarsened,
            bands_lost: self.bands_lost + other.bands_lost,
            bands_gained: self.bands_gained + other.bands_gained,
            over_budget: self.over_budget + other.over_budget,
        }
    }
}

/// The outcome of a density-control step.
pub struct Revision {
    /// The backend's plan; `None` if nothing changes.
    pub plan: Option<DensityPlan>,
    /// Histories of the splats after the plan.
    pub histories: Vec<SplatHistory>,
    /// What the plan does.
    pub counts: DensityCounts,
}

impl Revision {
    /// The revision that changes nothing.
    pub fn none(s: &Situation<'_>) -> Self {
        Self { plan: None, histories: s.histories.to_vec(), counts: DensityCounts::default() }
    }
}
