//! Structure decisions, made on the host from what was read back, alike for every backend: which splats
//! go, split or move, and what size their maps have (method sections 6, 7 and 9).

mod bounds;
mod candidate;
mod coarse;
mod decide;
mod draft;
mod geometry;
mod life;
mod maps;
mod relocate;
mod score;
mod settings;
mod spend;
mod split;
#[cfg(test)]
mod tests;

pub use decide::{DensityCounts, Revision, Situation, decide};
pub use geometry::{TEXELS_MAX, first_texel_size, half_extents, morton_codes, pixel_sizes};
pub use life::Life;
pub use maps::MapRule;
pub use relocate::relocate;
pub use settings::{
    Budget, Components, DensityConfig, ErrorMeasure, GrowthMoments, Spending, SplitProfile, StatisticsSource,
};
