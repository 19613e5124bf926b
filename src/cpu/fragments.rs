//! Counts the fragments that are blended (twin: `reference/fragments.rs`).

use super::pipeline::ViewPipeline;
use super::simd::SimdLevel;
use super::view::ViewF32;
use crate::camera::Camera;
use crate::model::Model;

/// Samples that are blended over the pixels of a view, mean over the views; 0 without any. Uses the threads of the caller.
pub fn blended_fragments(model: &Model, cameras: &[Camera]) -> f64 {
    let SimdLevel(level) = SimdLevel::best();
    let mut pipeline = ViewPipeline::default();
    let per_pixel = |camera: &Camera| {
        pipeline.project(level, model, ViewF32::new(camera, model));
        pipeline.without_maps();
        pipeline.raster(level, true, None);
        let counters = pipeline.counters();
        counters.blended_pairs as f64 / counters.pixels as f64
    };
    cameras.iter().map(per_pixel).sum::<f64>() / cameras.len().max(1) as f64
}
