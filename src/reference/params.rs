//! The model's stored parameters in f64, and gradients of the same shape.

use crate::model::{Model, SplatGroup, TextureMap, texel_value};
use glam::{DMat3, DQuat, DVec3};

/// Stored parameters of all splats and texels, or gradients with respect to them.
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    /// SH degree of each splat. `[n]`
    pub sh_degrees: Vec<u8>,
    /// Centres in the local frame. `[n, 3]`
    pub positions: Vec<f64>,
    /// Rotations local_from_surfel as wxyz, not normalised. `[n, 4]`
    pub quaternions: Vec<f64>,
    /// Logarithms of the standard deviations. `[n, 2]`
    pub log_scales: Vec<f64>,
    /// Opacities before the sigmoid. `[n]`
    pub opacity_logits: Vec<f64>,
    /// First float of each splat in `sh`, and the end of the last one. `[n + 1]`
    pub sh_offsets: Vec<u32>,
    /// SH coefficients, splat after splat. `[num_sh_coefficients, 3]`
    pub sh: Vec<f64>,
    /// Texels before activation. `[num_texels, 3]`
    pub texels: Vec<f64>,
    /// Position and size of each splat's map. `[n]`
    pub maps: Vec<TextureMap>,
}

impl Params {
    /// The parameters of a model in f64.
    pub fn from_model(model: &Model) -> Self {
        let wide = |v: &[f32]| v.iter().map(|&x| f64::from(x)).collect();
        let s = &model.splats;
        Self {
            sh_degrees: s.sh_degrees().to_vec(),
            sh_offsets: s.sh_offsets().to_vec(),
            positions: wide(&s.positions),
            quaternions: wide(&s.quaternions),
            log_scales: wide(&s.log_scales),
            opacity_logits: wide(&s.opacity_logits),
            sh: wide(&s.sh),
            texels: wide(&model.textures.texels),
            maps: model.textures.maps.clone(),
        }
    }

    /// Zeros in the same shape: an empty gradient.
    pub fn zeros_like(&self) -> Self {
        let mut out = self.clone();
        for group in SplatGroup::ALL {
            out.group_mut(group).fill(0.0);
        }
        out.texels.fill(0.0);
        out
    }

    /// Number of splats.
    pub fn len(&self) -> usize {
        self.opacity_logits.len()
    }

    /// Whether there are no splats.
    pub fn is_empty(&self) -> bool {
        self.opacity_logits.is_empty()
    }

    /// The array of a group. `[n, width]`, SH splat after splat
    pub fn group(&self, group: SplatGroup) -> &[f64] {
        match group {
            SplatGroup::Position => &self.positions,
            SplatGroup::Quaternion => &self.quaternions,
            SplatGroup::LogScale => &self.log_scales,
            SplatGroup::Opacity => &self.opacity_logits,
            SplatGroup::Sh => &self.sh,
        }
    }

    /// The array of a group, mutable. `[n, width]`, SH splat after splat
    pub fn group_mut(&mut self, group: SplatGroup) -> &mut [f64] {
        match group {
            SplatGroup::Position => &mut self.positions,
            SplatGroup::Quaternion => &mut self.quaternions,
            SplatGroup::LogScale => &mut self.log_scales,
            SplatGroup::Opacity => &mut self.opacity_logits,
            SplatGroup::Sh => &mut self.sh,
        }
    }

    /// Centre of splat `i`, local frame.
    pub fn position(&self, i: usize) -> DVec3 {
        DVec3::from_slice(&self.positions[3 * i..])
    }

    /// Quaternion of splat `i` as stored: wxyz, not normalised.
    pub fn quaternion(&self, i: usize) -> [f64; 4] {
        [0, 1, 2, 3].map(|k| self.quaternions[4 * i + k])
    }

    /// Rotation local_from_surfel of splat `i`; its columns are `e_u`, `e_v` and the normal.
    pub fn rotation(&self, i: usize) -> DMat3 {
        let [w, x, y, z] = self.quaternion(i);
        DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
    }

    /// Standard deviations of splat `i`, local units.
    pub fn scales(&self, i: usize) -> [f64; 2] {
        [self.log_scales[2 * i].exp(), self.log_scales[2 * i + 1].exp()]
    }

    /// Residual of the texel whose first float is `texel`.
    pub fn texel(&self, texel: usize) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|c| texel_value(self.texels[texel + c])))
    }

    /// Opacity of splat `i`, 0 to 1.
    pub fn opacity(&self, i: usize) -> f64 {
        1.0 / (1.0 + (-self.opacity_logits[i]).exp())
    }
}
