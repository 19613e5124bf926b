//! Blocks of pixels: where their rays meet a splat, alpha there, and the texture taps. Forward and backward pass call
//! the same functions and so get the same bits.

// Avoid `array::map` with vectors in its closure: the standard library's loop is not inlined into the
// `target_feature` context (measured: a call and a failed store forwarding per block).

use super::math::{BLOCK_PX, LANES, LaneMask, Lanes, exp};
use super::project::{MapView, ProjectedSplat};
use super::tile::BLOCK_COLS;
use crate::constants::{ALPHA_MIN, DENOMINATOR_MIN};
use fearless_simd::{Select as _, Simd, SimdBase as _, SimdFloat as _};

/// Pixel centres of a block, relative to the corner of its first pixel.
const LANE_X: [f32; LANES] = lane_centres(0);
const LANE_Y: [f32; LANES] = lane_centres(1);

const fn lane_centres(axis: usize) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    let mut lane = 0;
    while lane < LANES {
        out[lane] = [lane % BLOCK_PX[0], lane / BLOCK_PX[0]][axis] as f32 + 0.5;
        lane += 1;
    }
    out
}

/// Constants of a splat for the kernels, relative to a tile.
#[derive(Clone, Copy)]
pub(super) struct SplatInTile {
    /// Origin of the tile relative to the projected centre.
    offset_px: [f32; 2],
    a: [f32; 2],
    b: [f32; 2],
    g: [f32; 2],
    max_denominator: f32,
    pub near: f32,
    pub opacity: f32,
}

/// Intersection of a block's rays with a splat. Values of lanes outside the mask `inside` are finite.
pub(super) struct BlockHit<S: Simd> {
    pub dx: Lanes<S>,
    pub dy: Lanes<S>,
    pub denominator: Lanes<S>,
    pub per_denominator: Lanes<S>,
    /// Coordinates on the surfel in which the falloff is round.
    pub a: Lanes<S>,
    pub b: Lanes<S>,
    /// Opacity times falloff, before the clamp; 0 outside the mask.
    pub raw_alpha: Lanes<S>,
    /// Whether raw_alpha >= 1/255 and the hit is beyond the near plane.
    pub inside: LaneMask<S>,
}

impl SplatInTile {
    #[inline(always)]
    pub(super) fn new(splat: &ProjectedSplat, origin_px: [i32; 2], near: f32) -> Self {
        Self {
            offset_px: [origin_px[0] as f32 - splat.centre_px[0], origin_px[1] as f32 - splat.centre_px[1]],
            a: splat.a,
            b: splat.b,
            g: splat.g,
            max_denominator: splat.depth / near,
            near,
            opacity: splat.opacity,
        }
    }

    #[inline(always)]
    pub(super) fn hit<S: Simd>(&self, simd: S, block: usize) -> BlockHit<S> {
        let (row, col) = (block / BLOCK_COLS, block % BLOCK_COLS);
        let c = |v: f32| Lanes::splat(simd, v);
        let dx = Lanes::load_array(simd, LANE_X) + (self.offset_px[0] + (BLOCK_PX[0] * col) as f32);
        let dy = Lanes::load_array(simd, LANE_Y) + (self.offset_px[1] + (BLOCK_PX[1] * row) as f32);
        let denominator = dx.mul_add(c(self.g[0]), dy.mul_add(c(self.g[1]), c(1.0)));
        let in_front =
            denominator.simd_ge(DENOMINATOR_MIN as f32) & denominator.simd_le(self.max_denominator);
        let per_denominator = 1.0 / denominator.max(DENOMINATOR_MIN as f32);
        let a = dx.mul_add(c(self.a[0]), dy * self.a[1]) * per_denominator;
        let b = dx.mul_add(c(self.b[0]), dy * self.b[1]) * per_denominator;
        let q = a.mul_add(a, b * b);
        // The falloff at 40 is 2e-9; the bound keeps the exponent in range.
        let falloff = exp(simd, q.min(40.0_f32) * -0.5);
        let alpha = falloff * self.opacity;
        let inside = in_front & alpha.simd_ge(ALPHA_MIN as f32);
        let raw_alpha = inside.select(alpha, c(0.0));
        BlockHit { dx, dy, denominator, per_denominator, a, b, raw_alpha, inside }
    }
}

/// Texture coordinates of a block and the texels that its taps touch.
pub(super) struct BlockTaps<S: Simd> {
    pub u: Lanes<S>,
    pub v: Lanes<S>,
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
// Not an `Option`: that is returned through memory, with a failed store forwarding per block (measured: 7 % of the
// backward pass).
#[inline(always)]
pub(super) fn block_taps<S: Simd>(
    simd: S,
    map: &MapView,
    hit: &BlockHit<S>,
    mask: LaneMask<S>,
) -> BlockTaps<S> {
    let c = |v: f32| Lanes::splat(simd, v);
    let texels = &map.texels_per_coordinate;
    let u = hit.a.mul_add(c(texels.u_a), c(map.origin[0]));
    let v = hit.b.mul_add(c(texels.v_b), hit.a.mul_add(c(texels.v_a), c(map.origin[1])));
    let far = c(1e9);
    let rows = (mask.select(u, far).reduce_min(), mask.select(u, -far).reduce_max());
    let cols = (mask.select(v, far).reduce_min(), mask.select(v, -far).reduce_max());
    let range = |(low, high): (f32, f32), size: i32, reach: f32| {
        let past = ((high + reach).floor() as i32).saturating_add(1);
        (((low - reach).ceil() as i32).max(0), past.min(size))
    };
    let [along_u, along_v] = map.footprint.reach;
    BlockTaps { u, v, rows: range(rows, map.rows, along_u), cols: range(cols, map.cols, along_v) }
}

/// Length of a texel within a footprint whose centre is `d` away. The footprint ends half a texel before `reach`; at a
/// footprint and reach of 1, not `MINIFIED`, this is the weight of bilinear interpolation.
#[inline(always)]
fn overlap<S: Simd, const MINIFIED: bool>(d: Lanes<S>, reach: f32) -> Lanes<S> {
    if MINIFIED { (reach - d.abs()).max(0.0_f32).min(1.0_f32) } else { (1.0 - d.abs()).max(0.0_f32) }
}

/// [`overlap`] and its derivative with respect to the texture coordinate.
#[inline(always)]
pub(super) fn overlap_slope<S: Simd, const MINIFIED: bool>(
    simd: S,
    d: Lanes<S>,
    reach: f32,
) -> (Lanes<S>, Lanes<S>) {
    let texels = overlap::<S, MINIFIED>(d, reach);
    let mut on_edge = texels.simd_gt(0.0);
    if MINIFIED {
        on_edge &= d.abs().simd_ge(reach - 1.0);
    }
    (texels, on_edge.select(Lanes::splat(simd, -1.0).copysign(-d), Lanes::splat(simd, 0.0)))
}

/// Residual of each lane. `texels` are the activated texels of the map, `[rows, cols, 3]`.
#[inline(always)]
pub(super) fn residual<S: Simd>(
    simd: S,
    texels: &[f32],
    map: &MapView,
    taps: &BlockTaps<S>,
) -> [Lanes<S>; 3] {
    if map.footprint.is_minified {
        mean_residual::<S, true>(simd, texels, map, taps)
    } else {
        mean_residual::<S, false>(simd, texels, map, taps)
    }
}

#[inline(always)]
fn mean_residual<S: Simd, const MINIFIED: bool>(
    simd: S,
    texels: &[f32],
    map: &MapView,
    taps: &BlockTaps<S>,
) -> [Lanes<S>; 3] {
    let zero = Lanes::splat(simd, 0.0);
    let (mut red, mut green, mut blue) = (zero, zero, zero);
    let mut du = taps.u - taps.rows.0 as f32;
    let first_dv = taps.v - taps.cols.0 as f32;
    let width = 3 * (taps.cols.1 - taps.cols.0) as usize;
    for i in taps.rows.0..taps.rows.1 {
        let mut wu = overlap::<S, MINIFIED>(du, map.footprint.reach[0]);
        if MINIFIED {
            wu *= map.footprint.per_area;
        }
        du -= 1.0;
        let mut dv = first_dv;
        let row = &texels[3 * (i * map.cols + taps.cols.0) as usize..][..width];
        for texel in row.chunks_exact(3) {
            let w = wu * overlap::<S, MINIFIED>(dv, map.footprint.reach[1]);
            dv -= 1.0;
            red = w.mul_add(Lanes::splat(simd, texel[0]), red);
            green = w.mul_add(Lanes::splat(simd, texel[1]), green);
            blue = w.mul_add(Lanes::splat(simd, texel[2]), blue);
        }
    }
    [red, green, blue]
}

/// Broadcasts the channels of a colour to all lanes.
#[inline(always)]
pub(super) fn splat_rgb<S: Simd>(simd: S, rgb: [f32; 3]) -> [Lanes<S>; 3] {
    [Lanes::splat(simd, rgb[0]), Lanes::splat(simd, rgb[1]), Lanes::splat(simd, rgb[2])]
}
