//! How much images change with the parameters, measured with images of random signs.
//!
//! With weights r of random signs on all pixels and channels, the derivative of the sum of r times the image in a direction
//! d of the parameters is the sum over pixels and channels of r times their change. Its square has, as its mean over the
//! signs, the summed squared change of the image: the squared error that a move by d costs a model whose errors it does
//! not correlate with. The backward pass of any backend serves: the L1 loss against a photo of nothing but 0 and 255 has
//! such signs as its derivative, if the image stays between them. An exposure sees to that.

use crate::Result;
use crate::backend::{Backend, ColourMap, LearningRates, LossWeights, StepRequest, TargetImage};
use crate::camera::Camera;
use crate::constants::ADAM_BETA1;
use crate::model::{AdamState, Model};
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// Opacity logit up to which no alpha is clamped, so that derivatives tell what a splat adds: opacity 0.985.
const LOGIT_MAX: f32 = 4.18;

/// Stored texel value up to which the activation is steep enough for a derivative: a residual of 0.995.
const TEXEL_MAX: f32 = 6.0;

/// Slope of [`BETWEEN`].
const SLOPE: f32 = 0.25;

/// The exposure through which probes look: images between -1.5 and 2.5 stay between 0 and 1. Bright scenes leave that range,
/// and where the image is above both possible photos, the sign of the difference is no longer random.
pub const BETWEEN: ColourMap = {
    let offset = 0.5 - 0.5 * SLOPE;
    ColourMap([[SLOPE, 0.0, 0.0, offset], [0.0, SLOPE, 0.0, offset], [0.0, 0.0, SLOPE, offset]])
};

/// A view of a probe.
pub struct ProbeView<'a> {
    /// Camera of the view.
    pub camera: Camera,
    /// Its photo, of any size: a probe needs only the mask.
    pub photo: &'a TargetImage,
    /// Display-space colour behind all splats.
    pub background: [f32; 3],
    /// SH degree in use.
    pub sh_degree: u32,
}

/// The model as it is probed: no splat so opaque that its alpha would be clamped, and no texel saturated.
pub fn probed(mut model: Model) -> Model {
    model.splats.opacity_logits.iter_mut().for_each(|logit| *logit = logit.min(LOGIT_MAX));
    model.textures.texels.iter_mut().for_each(|texel| *texel = texel.clamp(-TEXEL_MAX, TEXEL_MAX));
    model
}

/// Derivatives of a weighted sum of the image of `view`, with weights of random signs divided by the square root of the
/// number of values: their squares are mean squared changes of the image. They are returned as first moments, and replace
/// the state in the backend.
///
/// # Errors
/// Whatever the backend reports.
pub fn probe(backend: &mut dyn Backend, model: &Model, view: &ProbeView<'_>, seed: u64) -> Result<AdamState> {
    probe_through(&BETWEEN, backend, model, view, seed)
}

/// As [`probe`], through an exposure that maps all channels alike.
pub fn probe_through(
    exposure: &ColourMap,
    backend: &mut dyn Backend,
    model: &Model,
    view: &ProbeView<'_>,
    seed: u64,
) -> Result<AdamState> {
    let target = signs(view.photo, &view.camera, seed);
    backend.upload(model, &AdamState::zeros(model))?;
    // With all rates zero, only the moments change.
    backend.steps(&[StepRequest {
        step: 1,
        camera: view.camera,
        photo: 0,
        target: &target,
        background: view.background,
        sh_degree: view.sh_degree,
        loss: LossWeights { l1: 1.0, ..LossWeights::NONE },
        rates: LearningRates::default(),
        accumulate_statistics: false,
        exposure: Some(*exposure),
    }])?;
    let (_, mut moments) = backend.read_back()?;
    let slope = f64::from(exposure.0[0][0]);
    let scale = ((target.rgb.len() as f64).sqrt() / (slope * (1.0 - ADAM_BETA1))) as f32;
    let AdamState { splats_m, texels_m, .. } = &mut moments;
    splats_m.opacity_logits.iter_mut().chain(&mut splats_m.sh).chain(texels_m).for_each(|m| *m *= scale);
    Ok(moments)
}

/// A photo of random zeros and ones for a camera, with the mask of another of any size.
fn signs(photo: &TargetImage, camera: &Camera, seed: u64) -> TargetImage {
    let [width_px, height_px] = [camera.pinhole.width_px, camera.pinhole.height_px];
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut rgb = vec![0_u8; 3 * (width_px * height_px) as usize];
    rng.fill_bytes(&mut rgb);
    rgb.iter_mut().for_each(|byte| *byte = if *byte < 128 { 0 } else { 255 });
    let place = |at: u32, side: u32, of: u32| (u64::from(at) * u64::from(of) / u64::from(side)) as usize;
    let mask = photo.mask.as_ref().map(|mask| {
        let row = |y: u32| place(y, height_px, photo.height_px) * photo.width_px as usize;
        let pixel = |y: u32, x: u32| mask[row(y) + place(x, width_px, photo.width_px)];
        (0..height_px).flat_map(|y| (0..width_px).map(move |x| (y, x))).map(|(y, x)| pixel(y, x)).collect()
    });
    TargetImage { width_px, height_px, rgb, mask, alpha: None }
}
