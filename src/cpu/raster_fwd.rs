//! Forward rasterisation of a tile (twin: `reference/raster_fwd.rs`). The outer loop visits splats front to back, the
//! inner loop blocks of pixels.

use super::block::{
    BLOCK_COLS, BlockHit, SplatInTile, block_at, block_taps, clamped_alpha, element_of, residual, splat_rgb,
    strip_span, strips,
};
use super::math::{LANES, Lanes};
use super::project::ProjectedSplat;
use super::tiles::{CPU_TILE_PX, Pair, TILE_PIXELS};
use crate::backend::RasterCounters;
use crate::constants::TRANSMITTANCE_MIN;
use fearless_simd::{Select as _, Simd, SimdBase as _, SimdFloat as _, SimdMask as _};

/// A value per pixel of a tile, block by block.
pub(super) type TilePlane = [f32; TILE_PIXELS];

/// Results of the forward pass for a tile.
#[derive(Clone)]
pub(super) struct TileOutput {
    /// Colour without background.
    pub rgb: [TilePlane; 3],
    /// Transmittance behind the last blended splat.
    pub transmittance: TilePlane,
    /// Index of the last blended pair of the tile, as a float; -1 if there is none.
    pub last: TilePlane,
    /// One past the last pair that any pixel blended.
    pub used_pairs: usize,
    pub counters: RasterCounters,
}

impl Default for TileOutput {
    fn default() -> Self {
        let zero = [0.0; TILE_PIXELS];
        Self {
            rgb: [zero; 3],
            transmittance: zero,
            last: zero,
            used_pairs: 0,
            counters: RasterCounters::default(),
        }
    }
}

/// Sums for depths, normals and the terms on them, if requested.
#[derive(Clone)]
pub(super) struct TileGeometry {
    pub depth: TilePlane,
    pub normal: [TilePlane; 3],
    /// Sums of weight times m and weight times m^2, with m the near depth over a sample's depth.
    pub moments: [TilePlane; 2],
}

impl Default for TileGeometry {
    fn default() -> Self {
        Self { depth: [0.0; TILE_PIXELS], normal: [[0.0; TILE_PIXELS]; 3], moments: [[0.0; TILE_PIXELS]; 2] }
    }
}

/// Input of the kernels for a tile.
pub(super) struct TileInput<'a> {
    pub splats: &'a [ProjectedSplat],
    /// Activated texels of the view.
    pub texels: &'a [f32],
    pub pairs: &'a [Pair],
    pub origin_px: [i32; 2],
    pub size_px: [u32; 2],
    pub near: f32,
}

impl TileInput<'_> {
    /// 1 for pixels of the tile within the image, else 0.
    pub(super) fn coverage(&self) -> TilePlane {
        let mut plane = [0.0; TILE_PIXELS];
        let extent = [0, 1]
            .map(|k| (self.size_px[k] as i32 - self.origin_px[k]).clamp(0, CPU_TILE_PX as i32) as usize);
        for y in 0..extent[1] {
            (0..extent[0]).for_each(|x| plane[element_of(x, y)] = 1.0);
        }
        plane
    }
}

/// Rasterises a tile. `COUNT` enables the pair counters.
#[inline(always)]
pub(super) fn raster_fwd<S: Simd, const COUNT: bool>(
    simd: S,
    input: &TileInput<'_>,
    out: &mut TileOutput,
    mut geometry: Option<&mut TileGeometry>,
) {
    // Transmittance of pixels that are still blending, 0 for those that have stopped.
    let mut live = input.coverage();
    out.rgb = [[0.0; TILE_PIXELS]; 3];
    out.transmittance = [1.0; TILE_PIXELS];
    out.last = [-1.0; TILE_PIXELS];
    out.used_pairs = 0;
    let mut counters = RasterCounters::default();
    let mut block_live = [true; TILE_PIXELS / LANES];
    let mut live_blocks = block_live.len();
    for (block, alive) in block_live.iter_mut().enumerate() {
        *alive = live[block * LANES..][..LANES].iter().any(|&t| t > 0.0);
        live_blocks -= usize::from(!*alive);
    }
    let zero = Lanes::splat(simd, 0.0);
    for (index, pair) in input.pairs.iter().enumerate() {
        if live_blocks == 0 {
            break;
        }
        let splat = &input.splats[pair.splat as usize];
        let in_tile = SplatInTile::new(splat, input.origin_px, input.near);
        let texels = &input.texels[splat.map.first as usize..];
        let (strip0, strip1) = strips(splat, input.origin_px);
        for strip in strip0..strip1 {
            let (col0, col1) = strip_span(splat, input.origin_px, strip);
            for col in col0..col1 {
                let block = strip * BLOCK_COLS + col;
                if !block_live[block] {
                    continue;
                }
                let at = block_at(strip, col)..block_at(strip, col) + LANES;
                let hit = in_tile.hit(simd, strip, col);
                if COUNT {
                    counters.evaluated_pairs += LANES as u64;
                    counters.inside_pairs += u64::from(hit.inside.to_bitmask().count_ones());
                }
                if !hit.inside.any_true() {
                    continue;
                }
                let before = Lanes::from_slice(simd, &live[at.clone()]);
                let alpha = clamped_alpha(&hit);
                let after = before * (1.0 - alpha);
                let blends = hit.inside & after.simd_ge(TRANSMITTANCE_MIN as f32);
                let now_live = hit.inside.select(blends.select(after, zero), before);
                now_live.store_slice(&mut live[at.clone()]);
                if !now_live.simd_gt(0.0).any_true() {
                    block_live[block] = false;
                    live_blocks -= 1;
                }
                if !blends.any_true() {
                    continue;
                }
                if COUNT {
                    counters.blended_pairs += u64::from(blends.to_bitmask().count_ones());
                }
                out.used_pairs = index + 1;
                let behind = Lanes::from_slice(simd, &out.transmittance[at.clone()]);
                blends.select(after, behind).store_slice(&mut out.transmittance[at.clone()]);
                let last = Lanes::from_slice(simd, &out.last[at.clone()]);
                blends.select(Lanes::splat(simd, index as f32), last).store_slice(&mut out.last[at.clone()]);
                let weight = blends.select(alpha * before, zero);
                let mut colour = splat_rgb(simd, splat.rgb);
                let taps = block_taps(simd, &splat.map, &hit, blends);
                if !taps.is_empty() {
                    let residual = residual(simd, texels, &splat.map, &taps);
                    for k in 0..3 {
                        colour[k] = (colour[k] + residual[k]).max(zero);
                    }
                }
                for k in 0..3 {
                    let plane = &mut out.rgb[k][at.clone()];
                    weight.mul_add(colour[k], Lanes::from_slice(simd, plane)).store_slice(plane);
                }
                if let Some(geometry) = geometry.as_deref_mut() {
                    add_geometry(simd, splat, input.near, weight, &hit, at, geometry);
                }
            }
        }
    }
    out.counters = counters;
}

#[inline(always)]
fn add_geometry<S: Simd>(
    simd: S,
    splat: &ProjectedSplat,
    near: f32,
    weight: Lanes<S>,
    hit: &BlockHit<S>,
    at: std::ops::Range<usize>,
    geometry: &mut TileGeometry,
) {
    let add = |plane: &mut [f32], value: Lanes<S>| {
        (Lanes::from_slice(simd, plane) + value).store_slice(plane);
    };
    add(&mut geometry.depth[at.clone()], weight * hit.per_denominator * splat.depth);
    let m = hit.denominator * (near / splat.depth);
    add(&mut geometry.moments[0][at.clone()], weight * m);
    add(&mut geometry.moments[1][at.clone()], weight * m * m);
    let (n, facing) = (splat.axes_in_camera[2], splat.facing());
    for k in 0..3 {
        add(&mut geometry.normal[k][at.clone()], weight * (facing * n[k]));
    }
}
