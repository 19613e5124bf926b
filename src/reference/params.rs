//! The model's stored parameters in f64, and gradients of the same shape.

use crate::model::{Model, SplatArrays, TextureMap, texel_value};
use glam::{DMat3, DQuat, DVec3};

/// Stored parameters of all splats and texels, or gradients with respect to them.
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    /// The splats.
    pub splats: SplatArrays<f64>,
    /// Texels before activation. `[num_texels, 3]`
    pub texels: Vec<f64>,
    /// Position and size of each splat's map. `[n]`
    pub maps: Vec<TextureMap>,
}

impl Params {
    /// The parameters of a model in f64.
    pub fn from_model(model: &Model) -> Self {
        Self {
            splats: model.splats.map(|&v| f64::from(v)),
            texels: model.textures.texels.iter().map(|&v| f64::from(v)).collect(),
            maps: model.textures.maps.clone(),
        }
    }

    /// Zeros in the same shape: an empty gradient.
    pub fn zeros_like(&self) -> Self {
        Self {
            splats: self.splats.map(|_| 0.0),
            texels: vec![0.0; self.texels.len()],
            maps: self.maps.clone(),
        }
    }

    /// Centre of splat `i`, local frame.
    pub fn position(&self, i: usize) -> DVec3 {
        DVec3::from_slice(&self.splats.positions[3 * i..])
    }

    /// Quaternion of splat `i` as stored: wxyz, not normalised.
    pub fn quaternion(&self, i: usize) -> [f64; 4] {
        [0, 1, 2, 3].map(|k| self.splats.quaternions[4 * i + k])
    }

    /// Rotation local_from_surfel of splat `i`; its columns are `e_u`, `e_v` and the normal.
    pub fn rotation(&self, i: usize) -> DMat3 {
        let [w, x, y, z] = self.quaternion(i);
        DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
    }

    /// Standard deviations of splat `i`, local units.
    pub fn scales(&self, i: usize) -> [f64; 2] {
        [self.splats.log_scales[2 * i].exp(), self.splats.log_scales[2 * i + 1].exp()]
    }

    /// Residual of the texel whose first float is `texel`.
    pub fn texel(&self, texel: usize) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|c| texel_value(self.texels[texel + c])))
    }

    /// Opacity of splat `i`, 0 to 1.
    pub fn opacity(&self, i: usize) -> f64 {
        1.0 / (1.0 + (-self.splats.opacity_logits[i]).exp())
    }
}
