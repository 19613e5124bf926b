//! Revisions of small models: what is pruned, split, refined and coarsened.

mod bands;
mod budget;
mod growth;
mod maps;
mod splats;

use super::decide::decide;
use super::geometry::{even_texels, first_texel_size, half_extents, opacity, sigmas};
use super::growth::{Growth, KINDS, Kind};
use super::history::{SplatHistory, Trial};
use super::outcome::Outcome;
use super::regrid::{cropped, surplus};
use super::settings::{Budget, Components, DensityConfig, Spending, SplitProfile};
use super::situation::{DensityCounts, Revision, Situation};
use super::sizes::MapRule;
use crate::backend::{Grid, MapChange, WindowStatistics};
use crate::camera::Camera;
use crate::constants::ALPHA_MIN;
use crate::model::{Model, ModelSize, TextureMap, TexturePool};
use crate::selftest::{RandomScene, SceneOptions, random_scene};

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
) -> Situation<'a> {
    Situation {
        model,
        histories,
        statistics,
        cameras,
        render_scale: 1.0,
        texture_cap: 256,
        densify: true,
        use_statistics: true,
        images_resized: false,
        may_coarsen: true,
        may_pad: true,
        sh_tested: 0,
        sh_trial_checks: 0,
        sh_highest: 3,
        texels_trained: true,
        growth: Growth::default(),
        step: 1,
        seed: 0,
        draws_growth: false,
        max_added: 100,
        initial_splats: 0,
        split_texels: 1000.0,
        patience: 8,
        opacity_floor: 0.02,
        rule: MapRule::Adaptive,
    }
}

/// Size of the model after a revision.
fn size_after(model: &Model, revision: &Revision) -> ModelSize {
    // No plan: nothing was possible.
    revision.plan.as_ref().map_or_else(|| model.size(), |plan| plan.size_after(model))
}

fn revise(s: &Situation<'_>, config: &DensityConfig, budget: &Budget) -> Revision {
    decide(s, config, &Components::default(), budget)
}

/// A window in which splat 5 has a much larger error than the others.
fn one_high_error() -> WindowStatistics {
    let mut errors = [0.1; N];
    errors[5] = 0.9;
    window(errors)
}
