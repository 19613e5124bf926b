//! The production backend for machines without a GPU: f32, all cores, SIMD chosen at run time.
//!
//! Every pass is a file of its own, and has an f64 twin of the same name in `reference`. Results do not depend on the
//! number of threads: parallel jobs write to disjoint memory, and each splat sums over its tiles in a fixed order.

mod adam;
mod apply_plan;
mod backend;
mod block;
mod bounds;
mod exposure;
mod fragments;
mod geometry;
mod loss;
mod maps;
mod math;
mod pipeline;
mod project;
mod project_bwd;
mod raster_bwd;
mod raster_fwd;
mod screen_bwd;
mod simd;
mod sums;
mod tile;
mod tiles;
mod update;
mod view;

pub use backend::{CpuBackend, PairCoverage};
pub use fragments::blended_fragments;
pub use simd::SimdLevel;
