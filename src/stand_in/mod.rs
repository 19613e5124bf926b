//! Stand-ins: small models of a whole scene, which stand at the beginning of a `.ltgs` file and are shown until enough of the scene
//! itself has arrived. They are trained on renders of the scene, so that no photos are needed.

mod rendered;
mod start;

use crate::backend::Backend;
use crate::bake::{asset_camera, bake, camera, model_from_asset};
use crate::model::Filter;
use crate::train::{Backdrop, MOST_STEPS, Policy, StepCosts, Timing, TrainConfig, TrainState, train_by};
use crate::verify::{Backends, FileRounder, SceneRenderer, evenly_spread};
use crate::{Error, Report, Result};
use litetex_exporters::ltgs::{LtgsOptions, encode};
use litetex_exporters::{AssetCamera, Filter as AssetFilter, Quality, SplatAsset};
use rendered::RenderedViews;
use std::time::Instant;

pub fn env(name: &str, otherwise: f64) -> f64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// Views that a stand-in is trained on, at most.
const VIEWS: usize = 64;

/// Longer side of their images, px.
const SIDE_PX: u32 = 256;

/// Makes the stand-in of a scene: a file of at most `max_bytes`.
pub fn make(scene: &SplatAsset, cameras: &[AssetCamera], max_bytes: u64, backends: &Backends<'_>) -> Result<Vec<u8>> {
    let side = env("LT_SIDE", SIDE_PX as f64) as u32;
    let views: Vec<AssetCamera> = evenly_spread(cameras, env("LT_VIEWS", VIEWS as f64) as usize)
        .iter()
        .map(|view| {
            let longer = view.width_px.max(view.height_px);
            let factor = (f64::from(side) / f64::from(longer)).min(1.0);
            let px = |px: u32| ((f64::from(px) * factor).round() as u32).max(1);
            asset_camera(&view.name, false, &camera(view).resized(px(view.width_px), px(view.height_px)))
        })
        .collect();
    let images = SceneRenderer::new((backends.rendering)()?, backends.go_on).images(scene, &views)?;
    let rendered = RenderedViews::new(views.clone(), &images);
    let config = TrainConfig {
        steps: env("LT_STEPS", 400.0) as u32,
        sh_degree: scene.sh_degree.min(env("LT_DEG", 1.0) as u32),
        policy: if env("LT_TEX", 0.0) > 0.0 { Policy::Litetex } else { Policy::Plain },
        max_bytes: Some(max_bytes),
        sweep: false,
        backdrop: Backdrop::None,
        filter: match scene.filter { AssetFilter::None => Filter::None, AssetFilter::Ewa => Filter::Ewa },
        background: scene.background,
        save_secs: 0,
        ..TrainConfig::default()
    };
    let frame = SplatAsset { near: scene.near, filter: scene.filter, background: scene.background, ..SplatAsset::default() };
    let mut rounder = FileRounder::new(frame.clone(), max_bytes, backends.statistics, backends.go_on)?.with_views(&views);
    let count = (env("LT_N", 0.08) * max_bytes as f64) as usize;
    let start = start::first_splats(scene, &views, count, config.sh_degree, backends)?;
    let began = Instant::now();
    let now = || began.elapsed().as_secs_f64();
    let timing = Timing { now: &now, deadline_secs: None, most_steps: MOST_STEPS, costs: StepCosts::CPU, end_secs: 0.0 };
    let mut backend: Box<dyn Backend> = (backends.rendering)()?;
    let go_on = backends.go_on;
    let (state, _) = train_by(&timing, &config, backend.as_mut(), Some(&mut rounder), &rendered, TrainState::fresh(model_from_asset(&start)), &mut |_| {
        if go_on() { Ok(crate::train::Control::Continue) } else { Err(Error::Interrupted) }
    })?;
    let last = state.rounded.as_ref().map(|last| &last.steps);
    let asset = bake(&state.model, Vec::new(), scene.background, Default::default(), &mut Report::default());
    let steps = last.map(|last| last.steps());
    let per_splat = last.map(|last| last.per_splat()).unwrap_or_default();
    eprintln!("stand-in: start {} splats, end {} splats {} texels, {:.1} s", start.num_splats(), asset.num_splats(), asset.num_texels(), now());
    Ok(encode(&asset, &LtgsOptions { quality: Quality::Custom, steps, per_splat, ..LtgsOptions::default() })?)
}
