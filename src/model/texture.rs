//! Texture maps of any rectangular size in one jagged pool. A texel is stored before activation and activated to a
//! residual in (-1, 1), which is added to the base colour.

use crate::Result;
use crate::constants::{ALPHA_MIN, MAP_SIGMA_MAX};

/// Position in the pool and size of one splat's map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TextureMap {
    /// Index of the map's first texel in the pool.
    pub offset_texels: u32,
    /// Texels along the surfel's axis u; 0: untextured.
    pub rows: u16,
    /// Texels along the surfel's axis v; 0: untextured.
    pub cols: u16,
    /// Edges of a texel along u and v, local units; 0: untextured.
    pub texel_sizes: [f32; 2],
    /// The map's centre along u and v, from the splat's centre, in half texels.
    pub shift: [i16; 2],
}

impl TextureMap {
    /// Highest side class: maps of more than 128 texels per side, of at most 256.
    pub const SIDE_CLASSES: usize = 8;

    /// A map about the splat's centre, with texels of these edges along u and v. Its first texel is yet to be placed.
    pub fn centred(rows: u16, cols: u16, texel_sizes: [f32; 2]) -> Self {
        Self { offset_texels: 0, rows, cols, texel_sizes, shift: [0; 2] }
    }

    /// As [`Self::centred`], with square texels.
    pub fn square(rows: u16, cols: u16, texel_size: f32) -> Self {
        Self::centred(rows, cols, [texel_size; 2])
    }

    /// Texture coordinates of the splat's centre. That of a point at `x` along u is `x / texel_sizes[0] + origin[0]`, and
    /// that of the centre of row `i` is `i`.
    pub fn origin(&self) -> [f32; 2] {
        let origin = |texels: u16, shift: i16| (f32::from(texels) - 1.0 - f32::from(shift)) / 2.0;
        [origin(self.rows, self.shift[0]), origin(self.cols, self.shift[1])]
    }

    /// Class of the longer side: 0 for untextured splats, 1 for up to 2 texels, 2 for up to 4, 3 for up to 8 and so
    /// on, at most [`Self::SIDE_CLASSES`].
    pub fn side_class(&self) -> usize {
        let side = u32::from(self.rows.max(self.cols));
        if side == 0 { 0 } else { (side.next_power_of_two().ilog2() as usize).clamp(1, Self::SIDE_CLASSES) }
    }

    /// Number of texels, rows times columns.
    pub fn num_texels(&self) -> usize {
        usize::from(self.rows) * usize::from(self.cols)
    }

    /// Range of the map's floats in [`TexturePool::texels`].
    pub fn floats(&self) -> std::ops::Range<usize> {
        let first = 3 * self.offset_texels as usize;
        first..first + 3 * self.num_texels()
    }
}

/// All maps and their texels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TexturePool {
    /// One per splat, in the order of their texels, without gaps.
    pub maps: Vec<TextureMap>,
    /// Texels before activation, map by map, row-major. `[num_texels, 3]` RGB
    pub texels: Vec<f32>,
}

impl TexturePool {
    /// The given maps with zero texels, placed one after the other.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] with counts if there are more texels than 32-bit offsets can address.
    pub fn neutral(extents: impl IntoIterator<Item = TextureMap>) -> Result<Self> {
        let mut num_texels = 0_u64;
        let mut maps = Vec::new();
        for map in extents {
            // Truncates only if the whole is refused below.
            maps.push(TextureMap { offset_texels: num_texels as u32, ..map });
            num_texels += map.num_texels() as u64;
        }
        if num_texels > u32::MAX.into() {
            return Err(usage!(
                "{num_texels} texels over {} maps, but a model may have at most {}; use fewer splats or smaller \
                 maps (max-points, --policy, budget.max-texels)",
                maps.len(),
                u32::MAX
            ));
        }
        Ok(Self { maps, texels: vec![0.0; 3 * num_texels as usize] })
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

/// Derivative of [`texel_value`] as a function of its value `v`.
pub fn texel_value_slope(v: f64) -> f64 {
    0.5 * (1.0 - v * v)
}

/// Half extent of a splat's map, local units: the larger standard deviation times the radius at which alpha falls
/// to 1/255, at most three (method 1.4). 0 if alpha never reaches 1/255.
pub fn support_half_extent(sigma_max: f64, opacity: f64) -> f64 {
    let radius = (2.0 * (opacity / ALPHA_MIN).ln()).max(0.0).sqrt();
    sigma_max * radius.min(MAP_SIGMA_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_many_texels_are_refused_with_counts() {
        // 2^32 texels are one more than fits; nothing is allocated.
        let error = TexturePool::neutral(std::iter::repeat_n(TextureMap::square(1 << 15, 1 << 15, 1.0), 4))
            .unwrap_err();
        assert!(matches!(error, crate::Error::Usage(_)) && error.exit_code() == 2, "{error}");
        let text = error.to_string();
        assert!(text.contains("4294967296 texels over 4 maps") && text.contains("4294967295"), "{text}");
        let pool = TexturePool::neutral(
            [(2, 3), (0, 0), (1, 4)].map(|(rows, cols)| TextureMap::square(rows, cols, 0.1)),
        );
        let pool = pool.unwrap();
        assert_eq!(pool.maps.iter().map(|m| m.offset_texels).collect::<Vec<_>>(), [0, 6, 6]);
        assert_eq!((pool.num_texels(), pool.texels.len()), (10, 30));
    }
}
