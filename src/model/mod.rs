//! The model in training: splats as structure of arrays, a jagged pool of texture maps, and the optimiser's
//! state. Plain data that knows no device and no file.

mod coarsening;
mod filter;
mod params;
mod splats;
mod texture;
pub mod tint;

pub use coarsening::Coarsening;
pub use filter::Filter;
pub use params::{MAP_PARAMS, ModelSize, TEXEL_PARAMS, splat_params};
pub use splats::{SplatArrays, SplatGroup};
pub use texture::{TextureMap, TexturePool, support_half_extent, texel_value, texel_value_slope};

use crate::camera::Similarity;
use serde::{Deserialize, Serialize};

/// Splats and texture maps, with the frame they are in: all that rendering needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Parameters of the splats, before activation.
    pub splats: SplatArrays,
    /// Texture maps, one per splat (0 x 0: untextured).
    pub textures: TexturePool,
    /// Near plane, local units: nearer samples and centres are not drawn.
    pub near: f32,
    /// Low-pass filter in the image.
    pub filter: Filter,
    /// Transform to the capture's frame from the local frame, in which the model is expressed.
    pub capture_from_local: Similarity,
}

impl Model {
    /// Number of splats.
    pub fn num_splats(&self) -> usize {
        self.splats.len()
    }

    /// Number of texels over all maps.
    pub fn num_texels(&self) -> usize {
        self.textures.num_texels()
    }

    /// Numbers of what the model is made of.
    pub fn size(&self) -> ModelSize {
        ModelSize {
            splats: self.num_splats(),
            sh_coefficients: self.splats.sh.len() / 3,
            maps: self.textures.maps.iter().filter(|map| map.num_texels() > 0).count(),
            texels: self.num_texels(),
        }
    }

    /// Floats that the model holds, see [`ModelSize::params`].
    pub fn num_params(&self) -> usize {
        self.size().params()
    }
}

/// Learning rates of one step (method 4.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LearningRates {
    /// Centres, local units.
    pub position: f32,
    /// Quaternions.
    pub quaternion: f32,
    /// Log-scales.
    pub log_scale: f32,
    /// Opacity logits.
    pub opacity: f32,
    /// SH degree 0.
    pub sh_dc: f32,
    /// SH degrees 1 to 3.
    pub sh_rest: f32,
    /// Texels of a 2 x 2 map; 0 before their training starts.
    pub texel: f32,
    /// Exponent by which larger maps learn faster, a map of T texels by (T / 4) to this power; 0: no faster.
    pub texel_growth: f32,
    /// Largest factor by which a map learns faster.
    pub texel_growth_limit: f32,
}

impl LearningRates {
    /// All rates, in the order of the fields.
    pub fn to_array(&self) -> [f32; 9] {
        [
            self.position,
            self.quaternion,
            self.log_scale,
            self.opacity,
            self.sh_dc,
            self.sh_rest,
            self.texel,
            self.texel_growth,
            self.texel_growth_limit,
        ]
    }

    /// Rate of the texels of a map with `num_texels` texels.
    pub fn of_map(&self, num_texels: usize) -> f32 {
        if self.texel_growth == 0.0 {
            return self.texel;
        }
        let factor = (num_texels as f32 / 4.0).powf(self.texel_growth);
        self.texel * factor.clamp(1.0, self.texel_growth_limit.max(1.0))
    }

    /// Inverse of [`Self::to_array`]; missing values are 0.
    pub fn from_array(values: &[f32]) -> Self {
        let at = |i: usize| values.get(i).copied().unwrap_or(0.0);
        Self {
            position: at(0),
            quaternion: at(1),
            log_scale: at(2),
            opacity: at(3),
            sh_dc: at(4),
            sh_rest: at(5),
            texel: at(6),
            texel_growth: at(7),
            texel_growth_limit: at(8),
        }
    }
}

/// State of Adam for every parameter of a [`Model`].
#[derive(Clone, Debug, PartialEq)]
pub struct AdamState {
    /// First moments of the splats' parameters.
    pub splats_m: SplatArrays,
    /// Second moments of the splats' parameters.
    pub splats_v: SplatArrays,
    /// First moments of the texels. `[num_texels, 3]`
    pub texels_m: Vec<f32>,
    /// Second moments of the texels. `[num_texels, 3]`
    pub texels_v: Vec<f32>,
    /// Step at which the lazily updated parameters (SH, texels) of each splat were last flushed.
    /// `[num_splats]`
    pub last_step: Vec<u32>,
    /// Steps done.
    pub step: u32,
    /// Rates of the last step, with which lagging parameters are flushed.
    pub rates: LearningRates,
}

impl AdamState {
    /// The state before the first step: all moments zero.
    pub fn zeros(model: &Model) -> Self {
        let n = model.num_splats();
        let zeros = SplatArrays::zeros_of(model.splats.sh_degrees().to_vec());
        Self {
            splats_m: zeros.clone(),
            splats_v: zeros,
            texels_m: vec![0.0; model.textures.texels.len()],
            texels_v: vec![0.0; model.textures.texels.len()],
            last_step: vec![0; n],
            step: 0,
            rates: LearningRates::default(),
        }
    }
}
