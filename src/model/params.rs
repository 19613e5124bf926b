//! Size of a model in parameters, the unit of budgets and results.

use crate::constants::sh_coefficients;

/// Parameters of a texture map besides its texels: the texel size.
pub const MAP_PARAMS: usize = 1;
/// Parameters of a texel: RGB.
pub const TEXEL_PARAMS: usize = 3;

/// Parameters of a splat without a texture map: centre 3, rotation 4, scales 2, opacity 1, and its SH coefficients.
pub const fn splat_params(sh_degree: u32) -> usize {
    10 + 3 * sh_coefficients(sh_degree)
}

/// Numbers of what a model is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModelSize {
    /// Number of splats.
    pub splats: usize,
    /// Number of splats with a texture map.
    pub maps: usize,
    /// Number of texels over all maps.
    pub texels: usize,
    /// SH degree that every splat stores.
    pub sh_degree: u32,
}

impl ModelSize {
    /// Splats with a map of so many texels each (0: without maps).
    pub fn uniform(splats: usize, texels_each: usize, sh_degree: u32) -> Self {
        let maps = if texels_each > 0 { splats } else { 0 };
        Self { splats, maps, texels: splats.saturating_mul(texels_each), sh_degree }
    }

    /// Floats that the model holds. Saturates.
    pub fn params(&self) -> usize {
        (self.splats.saturating_mul(splat_params(self.sh_degree)))
            .saturating_add(self.maps.saturating_mul(MAP_PARAMS))
            .saturating_add(self.texels.saturating_mul(TEXEL_PARAMS))
    }

    /// The count of the paper's tables: 59 per splat, whatever it stores, and 3 per texel.
    pub fn params_published(&self) -> usize {
        59 * self.splats + TEXEL_PARAMS * self.texels
    }
}
