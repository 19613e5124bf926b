//! Probes: how much images change with the parameters, measured with images of random signs.
//!
//! With weights r of random signs on all pixels and channels, the derivative of the sum of r times the image in a direction
//! d of the parameters is the sum over pixels and channels of r times their change. Its square has, as its mean over the
//! signs, the summed squared change of the image: the squared error that a move by d costs a model whose errors it does
//! not correlate with. The backward pass of any backend serves: the L1 loss against a photo of nothing but 0 and 255 has
//! such signs as its derivative, if the image stays between them. An exposure sees to that.

use super::exposure::ColourMap;
use crate::camera::Camera;
use crate::constants::{ADAM_BETA1, PROBED_LOGIT_MAX, PROBED_TEXEL_MAX};
use crate::image::TargetImage;
use crate::model::Model;
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// Slope of [`BETWEEN`].
const SLOPE: f32 = 0.25;

/// The exposure through which probes look: images between -1.5 and 2.5 stay between 0 and 1. Bright scenes leave that range,
/// and where the image is above both possible photos, the sign of the difference is no longer random.
pub const BETWEEN: ColourMap = {
    let offset = 0.5 - 0.5 * SLOPE;
    ColourMap([[SLOPE, 0.0, 0.0, offset], [0.0, SLOPE, 0.0, offset], [0.0, 0.0, SLOPE, offset]])
};

/// One view through random signs.
pub struct Probe {
    /// Camera of the view.
    pub camera: Camera,
    /// Random zeros and ones in place of the photo, with its mask.
    pub signs: TargetImage,
    /// Display-space colour behind all splats.
    pub background: [f32; 3],
    /// SH degree in use.
    pub sh_degree: u32,
    /// What it looks through, alike for all channels.
    pub exposure: ColourMap,
}

/// What the first moments of a probe of this many values, through an exposure, are multiplied by, so that their squares are mean
/// squared changes of the image.
pub fn probe_scale(values: usize, exposure: &ColourMap) -> f32 {
    let slope = f64::from(exposure.0[0][0]);
    ((values as f64).sqrt() / (slope * (1.0 - ADAM_BETA1))) as f32
}

impl Probe {
    /// A probe of a view, with signs by a seed. The photo may have any size: only its mask is needed.
    pub fn new(camera: Camera, photo: &TargetImage, background: [f32; 3], sh_degree: u32, seed: u64) -> Self {
        Self { camera, signs: signs(photo, &camera, seed), background, sh_degree, exposure: BETWEEN }
    }

    /// The [`probe_scale`] of this probe.
    pub fn scale(&self) -> f32 {
        probe_scale(self.signs.rgb.len(), &self.exposure)
    }
}

/// The model as it is probed: no splat so opaque that its alpha would be clamped, and no texel saturated (twin of
/// `shaders/prepare_probes.wgsl`).
pub fn probed(mut model: Model) -> Model {
    let [logit_max, texel_max] = [PROBED_LOGIT_MAX, PROBED_TEXEL_MAX].map(|most| most as f32);
    model.splats.opacity_logits.iter_mut().for_each(|logit| *logit = logit.min(logit_max));
    model.textures.texels.iter_mut().for_each(|texel| *texel = texel.clamp(-texel_max, texel_max));
    model
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
