//! What a density-control step is decided from, and what comes of it.

use super::growth::Growth;
use super::history::SplatHistory;
use super::settings::DensityConfig;
use super::sizes::MapRule;
use crate::backend::{DensityPlan, WindowStatistics};
use crate::camera::Camera;
use crate::model::Model;
use serde::Serialize;

/// What a revision is decided from.
pub struct Situation<'a> {
    /// The flushed model.
    pub model: &'a Model,
    /// Histories of its splats.
    pub histories: &'a [SplatHistory],
    /// Sums of the statistics window.
    pub statistics: &'a WindowStatistics,
    /// Cameras of the training views, at full size.
    pub cameras: &'a [Camera],
    /// Full image size divided by the current size in training.
    pub render_scale: f64,
    /// Current largest map side, in texels.
    pub texture_cap: u16,
    /// Whether images had another size in the window before, so that its errors cannot be compared with those of this one.
    pub images_resized: bool,
    /// Whether maps may be refined and splats split.
    pub densify: bool,
    /// Whether the statistics are used. Before the first density-control step and at crop steps they are not:
    /// maps are then only fitted to their support.
    pub use_statistics: bool,
    /// Whether texels have been trained long enough for their values to mean something.
    pub texels_trained: bool,
    /// Whether maps are tested for coarsening, and SH bands judged.
    pub may_coarsen: bool,
    /// Whether maps may be padded and resampled: until a round of giving back has taken off what is not needed.
    pub may_pad: bool,
    /// Highest SH degree that has been trained long enough to be judged; 0: none.
    pub sh_tested: u32,
    /// Checks after which a band that a splat gained is judged.
    pub sh_trial_checks: u16,
    /// Highest SH degree that a splat may have.
    pub sh_highest: u32,
    /// What growth was worth so far.
    pub growth: Growth,
    /// Steps done.
    pub step: u32,
    /// Seed of what is random in the step.
    pub seed: u64,
    /// Whether growth is drawn, and splats of any length are split.
    pub draws_growth: bool,
    /// Largest number of splats that may be added, not counting drawn splits.
    pub max_added: usize,
    /// Number of splats at initialisation.
    pub initial_splats: usize,
    /// Length in finest texels above which a splat is split.
    pub split_texels: f64,
    /// Prune count that removes a splat.
    pub patience: u16,
    /// Opacity below which splats fade.
    pub opacity_floor: f64,
    /// How the sizes of maps are decided.
    pub rule: MapRule,
}

impl Situation<'_> {
    /// Whether growth is compared with splats that are withheld: where it is drawn, and with `need_db`.
    pub fn measures_growth(&self, config: &DensityConfig) -> bool {
        self.draws_growth || config.need_db > 0.0
    }
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
    /// Splats split to replace pruned ones (`litetex` with `respawn`; `plain`).
    pub respawned: usize,
    /// Maps refined to twice the texels per side.
    pub refined: usize,
    /// Maps coarsened, dropped or made smaller to fit their ceiling or the budget.
    pub coarsened: usize,
    /// Maps whose refinement was in vain and is taken back.
    pub taken_back: usize,
    /// Splats that gave back SH degrees.
    pub shaded_less: usize,
    /// Splats that gained an SH degree.
    pub shaded_more: usize,
    /// Times that a candidate was not split, or not refined, for lack of budget.
    pub over_budget: usize,
}

/// The outcome of a density-control step.
pub struct Revision {
    /// The backend's plan; `None` if nothing changes.
    pub plan: Option<DensityPlan>,
    /// Histories of the splats after the plan.
    pub histories: Vec<SplatHistory>,
    /// What the plan does.
    pub counts: DensityCounts,
    /// What growth was worth.
    pub growth: Growth,
}
