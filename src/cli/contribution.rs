//! How much each splat contributes to the pictures of the training views.

use super::devices;
use super::log::Log;
use litetex_exporters::SplatAsset;
use litetex_gs::Result;
use litetex_gs::backend::{LearningRates, LossWeights, StepRequest, TargetImage, WindowStatistics};
use litetex_gs::bake::{camera, thaw};
use litetex_gs::model::AdamState;

/// Which splats contribute at least so many pixels to all views together that were trained on. `[n]`
///
/// # Errors
/// What the device reports.
pub fn at_least(asset: &SplatAsset, floor_px: f32, log: &Log) -> Result<Vec<bool>> {
    let model = thaw(asset);
    let mut backend = devices::open("cpu", log)?;
    backend.upload(&model, &AdamState::zeros(&model))?;
    let mut contribution = vec![0.0; model.num_splats()];
    for (i, view) in asset.cameras.iter().filter(|c| !c.held_out).enumerate() {
        let pixels = view.width_px as usize * view.height_px as usize;
        let target = TargetImage {
            width_px: view.width_px,
            height_px: view.height_px,
            rgb: vec![0; 3 * pixels],
            mask: None,
        };
        backend.set_statistics(&WindowStatistics::empty(model.num_splats()))?;
        // Statistics come with a step; without rates nothing moves.
        backend.step(&StepRequest {
            step: 1,
            camera: camera(view),
            photo: i as u32,
            target: &target,
            background: asset.background,
            sh_degree: asset.sh_degree,
            loss: LossWeights::default(),
            rates: LearningRates::default(),
            accumulate_statistics: true,
        })?;
        // Each view's statistics are shares of its own pixels.
        let of_view = backend.read_statistics()?.contribution;
        contribution.iter_mut().zip(of_view).for_each(|(sum, share)| *sum += share * pixels as f32);
    }
    Ok(contribution.iter().map(|c| *c >= floor_px).collect())
}
