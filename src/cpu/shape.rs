//! What forward and backward share per block of 4 x 2 pixels: where the rays meet the splat, its alpha
//! there, and the texture taps. One function each, so that both passes see the same bits.

//
// No `array::map` with vectors in its closure: the standard library's loop is not inlined into the
// `target_feature` context (measured: a call and a failed store forwarding per block).

use super::math::{LANES, exp};
use super::project::{MapView, ProjectedSplat};
use super::tiles::TILE_PX;
use crate::constants::{ALPHA_MAX, ALPHA_MIN, DENOMINATOR_MIN};
use fearless_simd::{Select as _, Simd, SimdBase as _, SimdFloat as _, f32x8, mask32x8};

/// Blocks per row of blocks of a tile.
pub(super) const BLOCK_COLS: usize = TILE_PX / 4;

/// Centres of a block's pixels relative to its first pixel's corner.
const LANE_X: [f32; LANES] = [0.5, 1.5, 2.5, 3.5, 0.5, 1.5, 2.5, 3.5];
const LANE_Y: [f32; LANES] = [0.5, 0.5, 0.5, 0.5, 1.5, 1.5, 1.5, 1.5];

/// First element of a block in arrays of a tile, which are laid out block by block.
#[inline(always)]
pub(super) fn block_at(strip: usize, col: usize) -> usize {
    (strip * BLOCK_COLS + col) * LANES
}

/// Element of pixel (x, y) of a tile.
pub(super) fn element_of(x: usize, y: usize) -> usize {
    block_at(y / 2, x / 4) + (y % 2) * 4 + x % 4
}

/// Block columns `first..past` of a strip of two rows that a splat may touch, tile coordinates.
#[inline(always)]
pub(super) fn strip_span(splat: &ProjectedSplat, origin_px: [i32; 2], strip: usize) -> (usize, usize) {
    let b = &splat.bounds;
    let y = origin_px[1] + 2 * strip as i32;
    let empty = (i32::MAX, i32::MIN);
    let row = |y: i32| {
        if y >= b.y0 && y < b.y1 { b.row_span(y) } else { empty }
    };
    let (upper, lower) = (row(y), row(y + 1));
    let first = upper.0.min(lower.0).max(origin_px[0]);
    let past = upper.1.max(lower.1).min(origin_px[0] + TILE_PX as i32);
    if first >= past {
        return (0, 0);
    }
    (((first - origin_px[0]) / 4) as usize, ((past - origin_px[0] + 3) / 4) as usize)
}

/// Strips `first..past` of a tile that a splat may touch.
#[inline(always)]
pub(super) fn strips(splat: &ProjectedSplat, origin_px: [i32; 2]) -> (usize, usize) {
    let first = (splat.bounds.y0 - origin_px[1]).max(0) / 2;
    let past = ((splat.bounds.y1 - origin_px[1]).min(TILE_PX as i32) + 1) / 2;
    (first as usize, past.max(0) as usize)
}

/// A splat's constants for the kernels.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    /// Tile's origin relative to the projected centre.
    offset_px: [f32; 2],
    a: [f32; 2],
    b: [f32; 2],
    g: [f32; 2],
    max_denominator: f32,
    pub opacity: f32,
}

/// A block's rays on a splat. Values of lanes outside the mask are finite.
pub(super) struct BlockHit<S: Simd> {
    pub dx: f32x8<S>,
    pub dy: f32x8<S>,
    pub per_denominator: f32x8<S>,
    /// Plane coordinates in standard deviations.
    pub a: f32x8<S>,
    pub b: f32x8<S>,
    pub falloff: f32x8<S>,
    /// Opacity times falloff, before the clamp; 0 outside the mask.
    pub raw_alpha: f32x8<S>,
    /// raw_alpha >= 1/255 and the hit is in front of the near plane.
    pub inside: mask32x8<S>,
}

impl Shape {
    #[inline(always)]
    pub(super) fn new(splat: &ProjectedSplat, origin_px: [i32; 2], near: f32) -> Self {
        Self {
            offset_px: [origin_px[0] as f32 - splat.centre_px[0], origin_px[1] as f32 - splat.centre_px[1]],
            a: splat.a,
            b: splat.b,
            g: splat.g,
            max_denominator: splat.depth / near,
            opacity: splat.opacity,
        }
    }

    #[inline(always)]
    pub(super) fn hit<S: Simd>(&self, simd: S, strip: usize, col: usize) -> BlockHit<S> {
        let c = |v: f32| f32x8::splat(simd, v);
        let dx = f32x8::load_array(simd, LANE_X) + (self.offset_px[0] + (4 * col) as f32);
        let dy = f32x8::load_array(simd, LANE_Y) + (self.offset_px[1] + (2 * strip) as f32);
        let denominator = dx.mul_add(c(self.g[0]), dy.mul_add(c(self.g[1]), c(1.0)));
        let in_front =
            denominator.simd_ge(DENOMINATOR_MIN as f32) & denominator.simd_le(self.max_denominator);
        let per_denominator = 1.0 / denominator.max(DENOMINATOR_MIN as f32);
        let a = dx.mul_add(c(self.a[0]), dy * self.a[1]) * per_denominator;
        let b = dx.mul_add(c(self.b[0]), dy * self.b[1]) * per_denominator;
        let q = a.mul_add(a, b * b);
        // Beyond 40 the falloff is 2e-9; the bound keeps the exponent in range.
        let falloff = exp(simd, q.min(40.0_f32) * -0.5);
        let alpha = falloff * self.opacity;
        let inside = in_front & alpha.simd_ge(ALPHA_MIN as f32);
        let raw_alpha = inside.select(alpha, c(0.0));
        BlockHit { dx, dy, per_denominator, a, b, falloff, raw_alpha, inside }
    }
}

/// Alpha after the clamp.
#[inline(always)]
pub(super) fn clamped_alpha<S: Simd>(hit: &BlockHit<S>) -> f32x8<S> {
    hit.raw_alpha.min(ALPHA_MAX as f32)
}

/// Texture coordinates of a block and the texels that its taps touch.
pub(super) struct BlockTaps<S: Simd> {
    pub u: f32x8<S>,
    pub v: f32x8<S>,
    pub rows: (i32, i32),
    pub cols: (i32, i32),
}

impl<S: Simd> BlockTaps<S> {
    /// Whether no texel of the map is touched.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.rows.0 >= self.rows.1 || self.cols.0 >= self.cols.1
    }
}

/// Taps of the lanes in `mask`. Ranges are half-open.
//
// No `Option`: returned through memory, it costs a failed store forwarding per block (measured: 7 % of
// the backward pass).
#[inline(always)]
pub(super) fn block_taps<S: Simd>(
    simd: S,
    map: &MapView,
    hit: &BlockHit<S>,
    mask: mask32x8<S>,
) -> BlockTaps<S> {
    let c = |v: f32| f32x8::splat(simd, v);
    let u = hit.a.mul_add(c(map.texels_per_sigma[0]), c(map.origin[0]));
    let v = hit.b.mul_add(c(map.texels_per_sigma[1]), c(map.origin[1]));
    let far = c(1e9);
    let rows = (mask.select(u, far).reduce_min(), mask.select(u, -far).reduce_max());
    let cols = (mask.select(v, far).reduce_min(), mask.select(v, -far).reduce_max());
    let range = |(low, high): (f32, f32), size: i32| {
        ((low.floor() as i32).max(0), (high.floor() as i32).saturating_add(2).min(size))
    };
    BlockTaps { u, v, rows: range(rows, map.rows), cols: range(cols, map.cols) }
}

/// Bilinear weight at distance `d` from a texel: a hat of half width 1.
#[inline(always)]
fn hat<S: Simd>(d: f32x8<S>) -> f32x8<S> {
    (1.0 - d.abs()).max(0.0_f32)
}

/// Bilinear weight at distance `d` from a texel, and its derivative by the texture coordinate.
#[inline(always)]
pub(super) fn hat_slope<S: Simd>(simd: S, d: f32x8<S>) -> (f32x8<S>, f32x8<S>) {
    let weight = hat(d);
    let zero = f32x8::splat(simd, 0.0);
    let slope = weight.simd_gt(0.0).select(f32x8::splat(simd, -1.0).copysign(-d), zero);
    (weight, slope)
}

/// Residual colour. `texels` are the map's activated texels, `[rows, cols, 3]`.
#[inline(always)]
pub(super) fn residual<S: Simd>(
    simd: S,
    texels: &[f32],
    map_cols: i32,
    taps: &BlockTaps<S>,
) -> [f32x8<S>; 3] {
    let zero = f32x8::splat(simd, 0.0);
    let (mut red, mut green, mut blue) = (zero, zero, zero);
    let mut du = taps.u - taps.rows.0 as f32;
    let first_dv = taps.v - taps.cols.0 as f32;
    let width = 3 * (taps.cols.1 - taps.cols.0) as usize;
    for i in taps.rows.0..taps.rows.1 {
        let wu = hat(du);
        du -= 1.0;
        let mut dv = first_dv;
        let row = &texels[3 * (i * map_cols + taps.cols.0) as usize..][..width];
        for texel in row.chunks_exact(3) {
            let w = wu * hat(dv);
            dv -= 1.0;
            red = w.mul_add(f32x8::splat(simd, texel[0]), red);
            green = w.mul_add(f32x8::splat(simd, texel[1]), green);
            blue = w.mul_add(f32x8::splat(simd, texel[2]), blue);
        }
    }
    [red, green, blue]
}

/// The three channels of a colour, one value for all lanes.
#[inline(always)]
pub(super) fn splat_rgb<S: Simd>(simd: S, rgb: [f32; 3]) -> [f32x8<S>; 3] {
    [f32x8::splat(simd, rgb[0]), f32x8::splat(simd, rgb[1]), f32x8::splat(simd, rgb[2])]
}
