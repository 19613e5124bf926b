//! Density control (method 6): which splats are pruned, split or relocated and what size their maps have,
//! decided on the host from the flushed model and its statistics, so that the decisions do not depend on the backend.

mod bounds;
mod budget_allocator;
mod candidate;
mod coarse;
mod decide;
mod draw;
mod geometry;
mod growth;
mod history;
mod in_vain;
mod maps;
mod outcome;
mod planned_splat;
mod rank_correlation;
mod regrid;
mod relocate;
mod score;
mod settings;
mod shading;
mod situation;
mod sizes;
mod split;
#[cfg(test)]
mod tests;

pub use coarse::Coarsening;
pub use decide::decide;
pub use geometry::{
    TEXELS_MAX, even_texels, first_texel_size, half_extents, morton_codes, opacity, pixel_sizes, sigmas,
};
pub use growth::{Growth, KINDS, Kind};
pub use history::{SplatHistory, Trial};
pub use outcome::Outcome;
pub use regrid::{cropped as cropped_map, window as map_window};
pub use relocate::relocate;
pub use settings::{
    Budget, Components, DensityConfig, ErrorMeasure, GrowthMoments, Spending, SplitProfile, Splits,
    StatisticsSource,
};
pub use situation::{DensityCounts, Revision, Situation};
pub use sizes::MapRule;
