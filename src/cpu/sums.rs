//! Sums over the pixels of a pair of tile and splat, which the backward pass makes and the chain rule takes.

use super::math::{LANES, Lanes};
use fearless_simd::{Simd, SimdBase as _, SimdFloat as _};

/// Sums over the pixels of a pair. Those by the coordinates (a, b) on the surfel hold what [`super::screen_bwd`] needs for the
/// derivatives with respect to the map from pixels to them: offsets in pixels follow from (a, b).
#[derive(Clone, Copy, Debug)]
#[repr(usize)]
pub(super) enum Sum {
    /// 1 if any pixel contributed; otherwise 0, and the rest of the record is not written.
    Touched,
    /// Derivative with respect to a, through falloff and texture.
    A,
    /// As `A`, by b.
    B,
    /// Derivative with respect to the logarithm of the distance from the centre, times a.
    RadialA,
    RadialB,
    /// Derivative with respect to the exponent, times products of the coordinates.
    ExponentAA,
    ExponentAB,
    ExponentBB,
    /// By the opacity after the filter.
    Opacity,
    Red,
    Green,
    Blue,
    Pixels,
    Weight,
    Error,
    /// Derivative with respect to a through the texture, times a and b.
    TextureAA,
    TextureAB,
    /// As `TextureAA`, by b.
    TextureBA,
    TextureBB,
    /// Derivative with respect to the denominator through the distortion term: the sum, times dx, times dy, with (dx, dy) a
    /// pixel's offset from the projected centre.
    D,
    DX,
    DY,
    /// By the centre's depth and the normal, through the distortion and normal terms.
    Depth,
    NormalX,
    NormalY,
    NormalZ,
    /// Number of sums. The texel sums of the pair's window follow, `[rows, cols, 3]`.
    Len,
}

/// Fixed part of a pair's partial sums.
pub(super) const HEADER_FLOATS: usize = Sum::Len as usize;

/// First of the sums that only splats with a map, or a loss with distortion and normal terms, add to.
pub(super) const FIRST_RARE: usize = Sum::TextureAA as usize;

/// Sums of a pair, per lane: those that every pair adds to, in registers where there are enough.
pub(super) struct Sums<S: Simd> {
    pub a: Lanes<S>,
    pub b: Lanes<S>,
    pub radial: [Lanes<S>; 2],
    pub exponent: [Lanes<S>; 3],
    /// Derivative with respect to alpha, times alpha.
    pub by_alpha: Lanes<S>,
    pub rgb: [Lanes<S>; 3],
    pub statistics: [Lanes<S>; 3],
}

impl<S: Simd> Sums<S> {
    #[inline(always)]
    pub(super) fn zero(simd: S) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        Self {
            a: zero,
            b: zero,
            radial: [zero; 2],
            exponent: [zero; 3],
            by_alpha: zero,
            rgb: [zero; 3],
            statistics: [zero; 3],
        }
    }

    /// Writes the sums over the lanes to a pair's record.
    #[inline(always)]
    pub(super) fn store(&self, opacity: f32, record: &mut [f32]) {
        let record = &mut record[..FIRST_RARE];
        record[Sum::Touched as usize] = 1.0;
        record[Sum::A as usize] = self.a.reduce_sum();
        record[Sum::B as usize] = self.b.reduce_sum();
        record[Sum::RadialA as usize] = self.radial[0].reduce_sum();
        record[Sum::RadialB as usize] = self.radial[1].reduce_sum();
        record[Sum::ExponentAA as usize] = self.exponent[0].reduce_sum();
        record[Sum::ExponentAB as usize] = self.exponent[1].reduce_sum();
        record[Sum::ExponentBB as usize] = self.exponent[2].reduce_sum();
        record[Sum::Opacity as usize] = self.by_alpha.reduce_sum() / opacity;
        record[Sum::Red as usize] = self.rgb[0].reduce_sum();
        record[Sum::Green as usize] = self.rgb[1].reduce_sum();
        record[Sum::Blue as usize] = self.rgb[2].reduce_sum();
        record[Sum::Pixels as usize] = self.statistics[0].reduce_sum();
        record[Sum::Weight as usize] = self.statistics[1].reduce_sum();
        record[Sum::Error as usize] = self.statistics[2].reduce_sum();
    }
}

/// The rare sums of a pair and then those of its texels, per lane, in memory.
pub(super) struct LaneSums<'a>(pub &'a mut [[f32; LANES]]);

impl LaneSums<'_> {
    #[inline(always)]
    pub(super) fn mul_add<S: Simd>(&mut self, simd: S, sum: Sum, x: Lanes<S>, y: Lanes<S>) {
        let lanes = &mut self.0[sum as usize - FIRST_RARE];
        x.mul_add(y, Lanes::load_array_ref(simd, lanes)).store_array(lanes);
    }

    #[inline(always)]
    pub(super) fn texels(&mut self) -> &mut [[f32; LANES]] {
        &mut self.0[HEADER_FLOATS - FIRST_RARE..]
    }
}
