//! Runs whose last part is rounded for a file of a wanted size.

use super::training::MemoryViews;
use litetex_exporters::{AssetCamera, Provenance, SplatAsset};
use litetex_gs::backend::Backend;
use litetex_gs::bake::{asset_camera, bake};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::Model;
use litetex_gs::rounding::Rounder;
use litetex_gs::train::{
    Control, MOST_STEPS, Sink, StepCosts, StopReason, Timing, TrainConfig, TrainEvent, TrainState, train_by,
};
use litetex_gs::verify::FileRounder;
use litetex_gs::views::ViewSource as _;
use litetex_gs::{Report, Result};

/// Less than with the finest steps, which take 11,371 bytes.
pub const MAX_BYTES: u64 = 10_000;

/// Cameras of the views, of which the first is held out.
pub fn cameras(views: &MemoryViews) -> Vec<AssetCamera> {
    (0..views.num_views()).map(|v| asset_camera(&format!("{v}.png"), v == 0, &views.camera(v))).collect()
}

/// Opens the backend that measures sensitivities.
pub fn statistics() -> Result<Box<dyn Backend>> {
    Ok(Box::new(CpuBackend::new(Some(2))?))
}

/// What rounds for a file of at most `max_bytes`.
pub fn rounder(views: &MemoryViews, max_bytes: u64) -> Result<FileRounder<'static>> {
    let frame = SplatAsset { cameras: cameras(views), ..SplatAsset::default() };
    FileRounder::new(frame, max_bytes, &statistics, &|| true)
}

/// Trains, with rounding or without, and returns the final state and every checkpoint.
pub fn run(
    backend: &mut dyn Backend,
    config: &TrainConfig,
    views: &MemoryViews,
    start: TrainState,
) -> (TrainState, Vec<TrainState>) {
    let mut saved = Vec::new();
    let mut sink = |event: TrainEvent<'_>| {
        if let TrainEvent::Checkpoint { state, .. } = event {
            saved.push(state.clone());
        }
        Ok(Control::Continue)
    };
    let (state, _) = attempt(backend, config, views, start, &mut sink).unwrap();
    (state, saved)
}

/// Trains, with rounding or without.
pub fn attempt(
    backend: &mut dyn Backend,
    config: &TrainConfig,
    views: &MemoryViews,
    start: TrainState,
    sink: Sink<'_>,
) -> Result<(TrainState, StopReason)> {
    let timing = Timing {
        now: &|| 0.0,
        deadline_secs: None,
        most_steps: MOST_STEPS,
        costs: StepCosts::CPU,
        end_secs: 0.0,
    };
    let mut rounder = config.max_bytes.map(|most| rounder(views, most).unwrap());
    let rounder = rounder.as_mut().map(|rounder| rounder as &mut dyn Rounder);
    train_by(&timing, config, backend, rounder, views, start, sink)
}

/// A model as an asset.
pub fn asset(model: &Model, views: &MemoryViews) -> SplatAsset {
    bake(model, cameras(views), [0.0; 3], Provenance::default(), &mut Report::default())
}

/// Numbers of each kind that differ by more than the rounding of activations. Needed: 1e-6, but 6.4e-5 for SH, of one splat, which was
/// not explained.
pub fn differing(a: &Model, b: &Model) -> [usize; 6] {
    let count = |a: &[f32], b: &[f32], tolerance: f32| {
        let differ = |(a, b): (&f32, &f32)| (a - b).abs() > tolerance * a.abs().max(0.1);
        a.iter().zip(b).filter(|&pair| differ(pair)).count()
    };
    let [a_splats, b_splats] = [&a.splats, &b.splats];
    [
        count(&a_splats.positions, &b_splats.positions, 1e-5),
        count(&a_splats.quaternions, &b_splats.quaternions, 1e-5),
        count(&a_splats.log_scales, &b_splats.log_scales, 1e-5),
        count(&a_splats.opacity_logits, &b_splats.opacity_logits, 1e-5),
        count(&a_splats.sh, &b_splats.sh, 1e-3),
        count(&a.textures.texels, &b.textures.texels, 1e-5),
    ]
}
