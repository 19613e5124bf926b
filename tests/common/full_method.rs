//! Short runs with the full method on the common scene, on any backend: every 5 steps a density-control step,
//! and every kind of change occurs.

use super::training::{BLACK, MemoryViews, damaged, scene, uploaded};
use litetex_gs::backend::{Backend, TargetImage};
use litetex_gs::model::{TextureMap, TexturePool};
use litetex_gs::train::density::{DensityCounts, first_texel_size};
use litetex_gs::train::{Control, Policy, TrainConfig, TrainEvent, TrainState, train};
use std::sync::Arc;

pub const STEPS: u32 = 40;

/// Settings of a short run with density control every 5 steps, in which every kind of change occurs.
pub fn config(policy: Policy) -> TrainConfig {
    let mut config =
        TrainConfig { steps: STEPS, sh_degree: 1, policy, save_every: 3, ..TrainConfig::default() };
    // Allows finer texels, since the images are small and the splats few.
    config.density.min_texel_px = 1.5;
    // Some splats are long enough to be split. Others fade, a tenth at the first density-control step and more
    // at each later one, and are replaced by splitting shorter ones whose maps cannot be refined.
    config.density.split_texels = [25.0; 2];
    config.density.opacity_floor = Some([0.35, 0.5]);
    config.density.quantile = 0.6;
    config.density.patience_steps = 1;
    config
}

/// Initial state of a run: maps of 2 x 2 texels, of the size that the policy fixes, or none.
pub fn start(policy: Policy) -> TrainState {
    let mut model = damaged(&scene());
    let highest = model.splats.sh_degree() as u8;
    model.splats.set_sh_degrees(&vec![highest; model.num_splats()]);
    let extents = (0..model.num_splats()).map(|i| {
        let half = [0, 1].map(|k| 2.5 * f64::from(model.splats.log_scales[2 * i + k]).exp());
        let size = first_texel_size(half);
        match policy {
            Policy::Plain => TextureMap::default(),
            Policy::Fixed(texels) => {
                TextureMap::square(texels, texels, (size / f64::from(texels - 1)) as f32)
            }
            _ => TextureMap::square(2, 2, size as f32),
        }
    });
    model.textures = TexturePool::neutral(extents.collect::<Vec<_>>()).unwrap();
    TrainState::fresh(model)
}

/// Results of a run.
pub struct RunRecord {
    pub last: TrainState,
    pub saved: Vec<TrainState>,
    /// Changes of each density-control step, and splats and texels after it.
    pub steps: Vec<(DensityCounts, usize, usize)>,
    /// Render scale after each density-control step.
    pub scales: Vec<f64>,
    /// Largest number of splats, of texels, and of parameters without those of maps.
    pub largest: [usize; 3],
}

/// Photos of the common scene, large enough for a coarse stage.
pub fn large_photos() -> MemoryViews {
    let scene = scene();
    let mut backend = uploaded(&scene.model);
    let views = (0..6).map(|i| {
        let mut camera = scene.camera.resized(176, 132);
        camera.camera_from_local.translation.x += 0.05 * (f64::from(i) - 2.5);
        let image = backend.render(&camera, &BLACK).unwrap();
        let rgb = image.rgb.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        (camera, Arc::new(TargetImage::opaque(176, 132, rgb)))
    });
    MemoryViews(views.collect())
}

/// Trains on photos of the common scene.
pub fn run_on(
    backend: &mut dyn Backend,
    config: &TrainConfig,
    views: &MemoryViews,
    start: TrainState,
) -> RunRecord {
    let (mut saved, mut steps, mut scales, mut largest) = (Vec::new(), Vec::new(), Vec::new(), [0; 3]);
    let mut sink = |event: TrainEvent<'_>| {
        match event {
            TrainEvent::Checkpoint { state, .. } => saved.push(state.clone()),
            TrainEvent::DensityControl { counts, size, render_scale, .. } => {
                steps.push((counts, size.splats, size.texels));
                scales.push(render_scale);
            }
            TrainEvent::Step { size, report, .. } => {
                assert_eq!(report.non_finite_gradients, 0, "{:?} {steps:?}", config.policy);
                let [splats, texels, params] = largest;
                largest = [splats.max(size.splats), texels.max(size.texels), params.max(size.params)];
            }
            _ => {}
        }
        Ok(Control::Continue)
    };
    let (last, _) = train(config, backend, views, start, &mut sink).unwrap();
    RunRecord { last, saved, steps, scales, largest }
}

impl RunRecord {
    /// Sum of the changes of all density-control steps.
    pub fn total(&self) -> DensityCounts {
        let add = |a: DensityCounts, b: &DensityCounts| DensityCounts {
            pruned: a.pruned + b.pruned,
            faded: a.faded + b.faded,
            split: a.split + b.split,
            respawned: a.respawned + b.respawned,
            refined: a.refined + b.refined,
            coarsened: a.coarsened + b.coarsened,
            bands_lost: a.bands_lost + b.bands_lost,
            bands_gained: a.bands_gained + b.bands_gained,
            over_budget: a.over_budget + b.over_budget,
        };
        self.steps.iter().fold(DensityCounts::default(), |sum, (counts, ..)| add(sum, counts))
    }
}

/// Whether every kind of change to splats and maps occurred.
pub fn is_all_done(counts: &DensityCounts) -> bool {
    let DensityCounts { pruned, faded, split, respawned, refined, coarsened, bands_lost, .. } = *counts;
    // Budgets need not be tight.
    [pruned + faded, split, respawned, refined, coarsened, bands_lost].iter().all(|&c| c > 0)
}

/// Whether two states are bit-identical, except for times.
pub fn same(a: &TrainState, b: &TrainState) -> bool {
    let without_times = |s: &TrainState| TrainState { history: Default::default(), ..s.clone() };
    without_times(a) == without_times(b)
}
