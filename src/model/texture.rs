//! Texture maps of any rectangular size in one jagged pool. A texel is stored before its activation
//! and activates to a residual in (-1, 1) that is added to the splat's colour.

use crate::constants::{ALPHA_MIN, MAP_SIGMA_MAX};

/// Place and size of one splat's map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureMap {
    /// Index of the map's first texel in the pool.
    pub offset_texels: u32,
    /// Texels along the surfel's axis u; 0: untextured.
    pub rows: u16,
    /// Texels along the surfel's axis v; 0: untextured.
    pub cols: u16,
    /// Edge of a texel, local units.
    pub texel_size: f32,
}

impl TextureMap {
    /// Number of texels.
    pub fn num_texels(&self) -> usize {
        usize::from(self.rows) * usize::from(self.cols)
    }

    /// Range of this map's floats in [`TexturePool::texels`].
    pub fn floats(&self) -> std::ops::Range<usize> {
        let first = 3 * self.offset_texels as usize;
        first..first + 3 * self.num_texels()
    }
}

/// All maps and their texels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TexturePool {
    /// One per splat; offsets rise in order and leave no gap.
    pub maps: Vec<TextureMap>,
    /// Texels before activation, map by map, row-major. `[num_texels, 3]` RGB
    pub texels: Vec<f32>,
}

impl TexturePool {
    /// Maps of the given `(rows, cols, texel_size)` with neutral texels.
    ///
    /// # Panics
    /// If the texel count exceeds `u32::MAX`; the forecast before training refuses such sizes.
    pub fn neutral(extents: impl IntoIterator<Item = (u16, u16, f32)>) -> Self {
        let mut offset_texels = 0_u32;
        let mut maps = Vec::new();
        for (rows, cols, texel_size) in extents {
            maps.push(TextureMap { offset_texels, rows, cols, texel_size });
            let count = u32::from(rows) * u32::from(cols);
            offset_texels = offset_texels.checked_add(count).expect("texel count fits u32");
        }
        Self { maps, texels: vec![0.0; 3 * offset_texels as usize] }
    }

    /// Number of texels over all maps.
    pub fn num_texels(&self) -> usize {
        self.texels.len() / 3
    }
}

/// Activation of a stored texel: `2 sigmoid(t) - 1 = tanh(t / 2)`, in (-1, 1).
pub fn texel_value(stored: f64) -> f64 {
    (0.5 * stored).tanh()
}

/// Derivative of [`texel_value`] expressed by its value `v`.
pub fn texel_value_slope(v: f64) -> f64 {
    0.5 * (1.0 - v * v)
}

/// Half extent of a splat's map, local units: its larger standard deviation times the radius at which
/// alpha falls to 1/255, at most three (method section 1.4); 0 where it never gets there.
pub fn support_half_extent(sigma_max: f64, opacity: f64) -> f64 {
    let radius = (2.0 * (opacity / ALPHA_MIN).ln()).max(0.0).sqrt();
    sigma_max * radius.min(MAP_SIGMA_MAX)
}
