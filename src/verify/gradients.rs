//! Gradients of an image loss with respect to the numbers of a model, from any backend: backends compute them in training
//! steps only, and after a step from zero moments, Adam's first moments are the gradients times `1 - beta1`.

use crate::Result;
use crate::backend::{Backend, ColourMap, LearningRates, LossValues, LossWeights, StepRequest, TargetImage};
use crate::bake::camera;
use crate::constants::ADAM_BETA1;
use crate::model::{AdamState, Model, SplatArrays};
use litetex_exporters::AssetCamera;

/// Smallest slope of an activation by which gradients are divided.
const SLOPE_MIN: f32 = 1e-4;

/// A loss of a model's image from one view.
pub(super) struct ImageLoss<'a> {
    /// The view.
    pub view: &'a AssetCamera,
    /// What the image is compared with.
    pub target: &'a TargetImage,
    /// Display-space colour behind all splats.
    pub background: [f32; 3],
    /// Weights of the terms.
    pub weights: LossWeights,
    /// Applied to the image before the comparison.
    pub exposure: Option<ColourMap>,
}

/// Derivatives of a loss with respect to the stored numbers of a model: log-scales, logits, texels before their activation.
pub(super) struct Gradients {
    /// Of the splats.
    pub splats: SplatArrays,
    /// Of the texels. `[num_texels, 3]`
    pub texels: Vec<f32>,
}

impl Gradients {
    /// The derivative with respect to the natural logarithm of a splat's opacity.
    pub fn by_log_opacity(&self, splat: usize, opacity: f32) -> f32 {
        // The logit's slope is o (1 - o), that of the logarithm 1 / o.
        self.splats.opacity_logits[splat] / (1.0 - opacity).max(SLOPE_MIN)
    }

    /// The derivative with respect to a channel of a texel, of this value: the float at `index` of the texels.
    pub fn by_texel(&self, index: usize, value: f32) -> f32 {
        // A texel is the hyperbolic tangent of half the stored number.
        self.texels[index] / (0.5 * (1.0 - value * value)).max(SLOPE_MIN)
    }
}

/// Measures gradients, and the loss itself, on a backend, which is left with a copy of the model. `zeros` are the model's
/// moments before the first step.
///
/// # Errors
/// What the device reports.
pub(super) fn gradients(
    backend: &mut dyn Backend,
    (model, zeros): (&Model, &AdamState),
    loss: &ImageLoss<'_>,
) -> Result<(Gradients, LossValues)> {
    let rates = LearningRates::from_array(&[0.0; 9]);
    backend.upload(model, zeros)?;
    let report = backend.step(&StepRequest {
        step: 1,
        camera: camera(loss.view),
        photo: None,
        target: loss.target,
        background: loss.background,
        sh_degree: model.splats.sh_degree(),
        loss: loss.weights,
        rates,
        accumulate_statistics: false,
        exposure: loss.exposure,
    })?;
    let (_, adam) = backend.read_back()?;
    let (mut splats, mut texels) = (adam.splats_m, adam.texels_m);
    let scale = (1.0 / (1.0 - ADAM_BETA1)) as f32;
    let arrays = splats.groups_mut().0.into_iter().chain([&mut texels]);
    arrays.flatten().for_each(|g| *g *= scale);
    Ok((Gradients { splats, texels }, report.loss))
}
