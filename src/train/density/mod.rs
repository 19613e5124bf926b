//! Density control (method 6): which splats are pruned, split or relocated, what size their maps have and which SH bands they
//! hold, decided on the host from the flushed model and its statistics, so that the decisions do not depend on the backend.

mod bounds;
mod draw;
mod geometry;
mod history;
mod need;
mod ops;
mod plan;
mod policy;
mod rule;
mod settings;
mod situation;
mod sizes;
mod stats;
#[cfg(test)]
mod tests;

pub use geometry::{
    TEXELS_MAX, even_texels, first_texel_size, half_extents, morton_codes, opacity, pixel_sizes, sigmas,
};
pub use history::SplatHistory;
pub use need::Growth;
pub use ops::coarse::coarsened;
pub use ops::regrid::{cropped as cropped_map, window as map_window};
pub use policy::{FirstMap, Policy, PolicySpec, Rule, policies};
pub use rule::{RuleSpec, SplitShare};
pub use settings::{Bound, Budget, Components, DensityConfig};
pub use situation::{DensityCounts, Revision, Situation, Timing};
pub use sizes::MapRule;

/// Decides a density-control step.
pub fn revise(policy: Policy, s: &Situation<'_>) -> Revision {
    policy.spec().rule.revise(s)
}
