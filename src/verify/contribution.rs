//! How much each splat contributes to the views of a scene.

use super::renderer::GoOn;
use crate::backend::{Backend, LearningRates, LossWeights, StepRequest, TargetImage, WindowStatistics};
use crate::bake::{camera, model_from_asset};
use crate::model::AdamState;
use crate::{Error, Result};
use litetex_exporters::{AssetCamera, SplatAsset};

/// What each splat contributes to a set of views.
pub struct Contribution {
    /// Sum of the blending weights over all pixels. `[num_splats]`
    pub weight_px: Vec<f32>,
}

impl Contribution {
    /// Measures the splats of an asset on a backend, which keeps the asset's model.
    ///
    /// # Errors
    /// What the device reports, [`Error::Interrupted`].
    pub fn measure(
        backend: &mut dyn Backend,
        asset: &SplatAsset,
        views: &[AssetCamera],
        go_on: GoOn<'_>,
    ) -> Result<Self> {
        let model = model_from_asset(asset);
        backend.upload(&model, &AdamState::zeros(&model))?;
        let mut all = Self { weight_px: vec![0.0; model.num_splats()] };
        for view in views {
            if !go_on() {
                return Err(Error::Interrupted);
            }
            backend.set_statistics(&WindowStatistics::empty(model.num_splats()))?;
            step_without_learning(backend, asset, view)?;
            all.add(&backend.read_statistics()?, num_pixels(view) as f32);
        }
        Ok(all)
    }

    /// Adds the statistics of one view, which are shares of its pixels.
    fn add(&mut self, of_view: &WindowStatistics, pixels: f32) {
        for (sum, weight) in self.weight_px.iter_mut().zip(&of_view.contribution) {
            *sum += weight * pixels;
        }
    }
}

/// Backends accumulate statistics in training steps only; with learning rates of zero nothing moves.
fn step_without_learning(backend: &mut dyn Backend, asset: &SplatAsset, view: &AssetCamera) -> Result<()> {
    let target = TargetImage::opaque(view.width_px, view.height_px, vec![0; 3 * num_pixels(view)]);
    backend.step(&StepRequest {
        step: 1,
        camera: camera(view),
        photo: None,
        target: &target,
        background: asset.background,
        sh_degree: asset.sh_degree,
        loss: LossWeights::default(),
        rates: LearningRates::default(),
        accumulate_statistics: true,
        exposure: None,
    })?;
    Ok(())
}

fn num_pixels(view: &AssetCamera) -> usize {
    view.width_px as usize * view.height_px as usize
}
