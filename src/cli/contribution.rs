//! How much each splat contributes to images.

use super::devices;
use super::interrupt::Interrupt;
use super::log::Log;
use litetex_exporters::{AssetCamera, SplatAsset};
use litetex_gs::Result;
use litetex_gs::backend::{LearningRates, LossWeights, StepRequest, TargetImage, WindowStatistics};
use litetex_gs::bake::{camera, thaw};
use litetex_gs::model::AdamState;

/// What splats contribute to some views together.
pub struct Contribution {
    /// Sum of the blending weights. `[n]`
    pub weight_px: Vec<f32>,
    /// Sum of the squared blending weights, as if each were the same in all pixels of a view. `[n]`
    pub squared_weight_px: Vec<f32>,
}

impl Contribution {
    /// Of the splats of a scene.
    ///
    /// # Errors
    /// What the device reports, [`litetex_gs::Error::Interrupted`].
    pub fn of(asset: &SplatAsset, views: &[AssetCamera], log: &Log) -> Result<Self> {
        let model = thaw(asset);
        let mut backend = devices::open("cpu", log)?;
        backend.upload(&model, &AdamState::zeros(&model))?;
        let none = vec![0.0; model.num_splats()];
        let mut all = Self { weight_px: none.clone(), squared_weight_px: none };
        let interrupt = Interrupt::current();
        for (i, view) in views.iter().enumerate() {
            interrupt.check()?;
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
            let of_view = backend.read_statistics()?;
            for (splat, (weight, area)) in of_view.contribution.iter().zip(&of_view.area).enumerate() {
                all.weight_px[splat] += weight * pixels as f32;
                if *area > 0.0 {
                    all.squared_weight_px[splat] += weight * weight / area * pixels as f32;
                }
            }
        }
        Ok(all)
    }
}
