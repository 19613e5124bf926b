//! Size of a model in parameters, the unit of budgets and results.

use crate::constants::sh_coefficients;

/// Parameters of a texture map besides its texels: their sizes along u and v.
pub const MAP_PARAMS: usize = 2;
/// Parameters of a texel: RGB.
pub const TEXEL_PARAMS: usize = 3;

/// Parameters of a splat without colour: centre 3, rotation 4, scales 2, opacity 1.
const BARE_SPLAT_PARAMS: usize = 10;

/// Parameters of a splat without a texture map.
pub const fn splat_params(sh_degree: u32) -> usize {
    BARE_SPLAT_PARAMS + 3 * sh_coefficients(sh_degree)
}

/// Numbers of what a model is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModelSize {
    /// Number of splats.
    pub splats: usize,
    /// Number of SH coefficients over all splats, RGB as one.
    pub sh_coefficients: usize,
    /// Number of splats with a texture map.
    pub maps: usize,
    /// Number of texels over all maps.
    pub texels: usize,
}

impl ModelSize {
    /// Splats of one SH degree with a map of this many texels each (0: without maps).
    pub fn uniform(splats: usize, texels_each: usize, sh_degree: u32) -> Self {
        Self {
            splats,
            sh_coefficients: splats.saturating_mul(sh_coefficients(sh_degree)),
            maps: if texels_each > 0 { splats } else { 0 },
            texels: splats.saturating_mul(texels_each),
        }
    }

    /// Floats that the model holds. Saturates.
    pub fn params(&self) -> usize {
        (self.splats.saturating_mul(BARE_SPLAT_PARAMS))
            .saturating_add(self.sh_coefficients.saturating_mul(3))
            .saturating_add(self.maps.saturating_mul(MAP_PARAMS))
            .saturating_add(self.texels.saturating_mul(TEXEL_PARAMS))
    }

    /// The count of the paper's tables: 59 per splat, whatever it stores, and 3 per texel.
    pub fn params_published(&self) -> usize {
        59 * self.splats + TEXEL_PARAMS * self.texels
    }
}
