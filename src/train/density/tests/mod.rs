//! Revisions of small models: what is pruned, split, refined and coarsened.

mod bands;
mod budget;
mod growth;
mod maps;
mod splats;

use super::geometry::{even_texels, first_texel_size, half_extents, opacity, sigmas};
use super::history::SplatHistory;
use super::ops::map::Moments;
use super::ops::regrid::{cropped, surplus};
use super::ops::split::Profile;
use super::rule::{litetex, paper};
use super::settings::{Budget, Components, DensityConfig};
use super::situation::{DensityCounts, Revision, Situation, Timing};
use super::sizes::MapRule;
use super::stats::ErrorMeasure;
use crate::backend::{Grid, MapChange, WindowStatistics};
use crate::camera::Camera;
use crate::constants::ALPHA_MIN;
use crate::model::{Model, ModelSize, TextureMap, TexturePool};
use crate::selftest::{RandomScene, SceneOptions, random_scene};
use crate::train::charge::Charge;

const N: usize = 12;

/// Splats at a depth of about 1, with maps of `texels` per side that fit their support.
fn model(texels: u16) -> Model {
    let mut model = scene().model;
    let extents = (0..N).map(|i| {
        let half = half_extents(sigmas(&model, i), opacity(&model, i), ALPHA_MIN);
        let size = first_texel_size(half) / f64::from(texels - 1);
        let [rows, cols] = half.map(|h| even_texels(h, size) as u16);
        TextureMap::square(rows, cols, size as f32)
    });
    model.textures = TexturePool::neutral(extents.collect::<Vec<_>>()).unwrap();
    model.textures.texels.iter_mut().enumerate().for_each(|(i, t)| *t = (i as f32 * 0.7).sin());
    model
}

/// Maps as wide as the support, like those of the models here.
fn settings() -> DensityConfig {
    DensityConfig { alpha_texture: ALPHA_MIN, quantile: 0.85, ..DensityConfig::default() }
}

fn scene() -> RandomScene {
    random_scene(&SceneOptions {
        num_splats: N,
        map_sizes: vec![(2, 2)],
        scales: (0.1, 0.11),
        opacities: (0.5, 0.6),
        depths: (0.9, 1.1),
        ..SceneOptions::default()
    })
}

fn camera() -> Camera {
    scene().camera
}

/// A window in which every splat is visible and useful, with these errors.
fn window(errors: [f32; N]) -> WindowStatistics {
    WindowStatistics {
        views: 1,
        seen: vec![1; N],
        area: vec![0.1; N],
        contribution: vec![0.1; N],
        error: errors.map(|e| 0.1 * e).to_vec(),
    }
}

fn situation<'a>(
    model: &'a Model,
    histories: &'a [SplatHistory],
    statistics: &'a WindowStatistics,
    cameras: &'a [Camera],
    settings: &'a DensityConfig,
) -> Situation<'a> {
    Situation {
        model,
        histories,
        statistics,
        cameras,
        settings,
        components: Components::default(),
        map_rule: MapRule::Adaptive,
        render_scale: 1.0,
        texture_cap: 256,
        timing: TIMING,
        charge: Charge::PARAMS,
        budget: Budget::default(),
        most_charge: f64::INFINITY,
        initial_splats: 0,
        seed: 0,
    }
}

const TIMING: Timing = Timing {
    grows: true,
    use_statistics: true,
    texels_trained: true,
    may_coarsen: true,
    may_pad: true,
    sh_tested: 0,
    sh_trial_checks: 0,
    sh_highest: 3,
    max_splits: 100,
    split_texels: Some(1000.0),
    patience: 8,
    opacity_floor: 0.02,
};

/// The published rule.
fn revise_as_paper(s: &Situation<'_>) -> Revision {
    let variant = paper::Variant { error: ErrorMeasure::Mean, moments: Moments::Kept, first_ceiling: 2 };
    paper::revise(s, &variant)
}

/// Size of the model after a revision.
fn size_after(model: &Model, revision: &Revision) -> ModelSize {
    // No plan: nothing was possible.
    revision.plan.as_ref().map_or_else(|| model.size(), |plan| plan.size_after(model))
}

/// A window in which splat 5 has a much larger error than the others.
fn one_high_error() -> WindowStatistics {
    let mut errors = [0.1; N];
    errors[5] = 0.9;
    window(errors)
}
