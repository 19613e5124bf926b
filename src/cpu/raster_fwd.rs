//! Forward rasterisation of a tile (twin: `reference/raster_fwd.rs`). The outer loop visits splats front to back, the
//! inner loop blocks of pixels.

use super::block::{BlockHit, SplatInTile, block_taps, residual, splat_rgb};
use super::math::{LANES, Lanes};
use super::project::ProjectedSplat;
use super::tile::{BLOCKS, BlockSet, CPU_TILE_PX, TilePlane, place_of, take_first};
use super::tiles::Pair;
use crate::backend::RasterCounters;
use crate::constants::{ALPHA_MAX, TRANSMITTANCE_MIN};
use fearless_simd::{Select as _, Simd, SimdBase as _, SimdFloat as _, SimdMask as _};

/// Results of the forward pass for a block of pixels, side by side: in planes, they would lie 4 KiB apart and compete
/// for the same lines of the cache.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct OutputBlock {
    /// Colour without background.
    pub rgb: [[f32; LANES]; 3],
    /// Transmittance behind the last blended splat; negative for pixels that blend no more.
    transmittance: [f32; LANES],
    /// Index of the last blended pair of the tile, as a float; -1 if there is none.
    pub last: [f32; LANES],
}

impl OutputBlock {
    /// Transmittance of a pixel behind the last blended splat.
    #[inline(always)]
    pub(super) fn transmittance(&self, lane: usize) -> f32 {
        self.transmittance[lane].abs()
    }
}

/// Results of the forward pass for a tile.
#[derive(Clone, Default)]
pub(super) struct TileOutput {
    pub blocks: Vec<OutputBlock>,
    /// Where each pair was blended, up to the last one that any pixel blended.
    pub blended: Vec<BlockSet>,
    pub counters: RasterCounters,
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
        let zero = [[0.0; LANES]; BLOCKS];
        Self { depth: zero, normal: [zero; 3], moments: [zero; 2] }
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
    /// Whether pixel (x, y) of the tile lies within the image.
    fn covers(&self, x: usize, y: usize) -> bool {
        [x, y].into_iter().enumerate().all(|(k, at)| self.origin_px[k] + (at as i32) < self.size_px[k] as i32)
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
    let TileOutput { blocks, blended, .. } = out;
    let start = OutputBlock { rgb: [[0.0; LANES]; 3], transmittance: [-1.0; LANES], last: [-1.0; LANES] };
    blocks.clear();
    blocks.resize(BLOCKS, start);
    blended.clear();
    // Blocks with pixels that still blend.
    let mut live: BlockSet = 0;
    for (y, x) in (0..CPU_TILE_PX).flat_map(|y| (0..CPU_TILE_PX).map(move |x| (y, x))) {
        if input.covers(x, y) {
            let (block, lane) = place_of(x, y);
            blocks[block].transmittance[lane] = 1.0;
            live |= 1 << block;
        }
    }
    let mut counters = RasterCounters::default();
    let mut used_pairs = 0;
    let zero = Lanes::splat(simd, 0.0);
    for (index, pair) in input.pairs.iter().enumerate() {
        if live == 0 {
            break;
        }
        let splat = &input.splats[pair.splat as usize];
        let in_tile = SplatInTile::new(splat, input.origin_px, input.near);
        let texels = &input.texels[splat.map.first as usize..];
        let mut left = pair.blocks & live;
        let mut blended_here: BlockSet = 0;
        while left != 0 {
            let block = take_first(&mut left);
            let hit = in_tile.hit(simd, block);
            if COUNT {
                counters.evaluated_pairs += LANES as u64;
                counters.inside_pairs += u64::from(hit.inside.to_bitmask().count_ones());
            }
            if !hit.inside.any_true() {
                continue;
            }
            let state = &mut blocks[block];
            let before = Lanes::load_array_ref(simd, &state.transmittance);
            let alpha = hit.raw_alpha.min(ALPHA_MAX as f32);
            let after = before * (1.0 - alpha);
            // Also outside the splat, where alpha is 0.
            let goes_on = after.simd_ge(TRANSMITTANCE_MIN as f32);
            let blends = hit.inside & goes_on;
            let now = goes_on.select(after, -before.abs());
            now.store_array(&mut state.transmittance);
            if !goes_on.any_true() {
                live &= !(1 << block);
            }
            if !blends.any_true() {
                continue;
            }
            if COUNT {
                counters.blended_pairs += u64::from(blends.to_bitmask().count_ones());
            }
            blended_here |= 1 << block;
            let last = Lanes::load_array_ref(simd, &state.last);
            blends.select(Lanes::splat(simd, index as f32), last).store_array(&mut state.last);
            let weight = goes_on.select(alpha * before, zero);
            let mut colour = splat_rgb(simd, splat.rgb);
            if splat.map.has_texels() {
                let taps = block_taps(simd, &splat.map, &hit, blends);
                if !taps.is_empty() {
                    let residual = residual(simd, texels, &splat.map, &taps);
                    for k in 0..3 {
                        colour[k] = (colour[k] + residual[k]).max(zero);
                    }
                }
            }
            for k in 0..3 {
                let sum = Lanes::load_array_ref(simd, &state.rgb[k]);
                weight.mul_add(colour[k], sum).store_array(&mut state.rgb[k]);
            }
            if let Some(geometry) = geometry.as_deref_mut() {
                add_geometry(simd, splat, input.near, weight, &hit, block, geometry);
            }
        }
        blended.push(blended_here);
        if blended_here != 0 {
            used_pairs = index + 1;
        }
    }
    blended.truncate(used_pairs);
    out.counters = counters;
}

#[inline(always)]
fn add_geometry<S: Simd>(
    simd: S,
    splat: &ProjectedSplat,
    near: f32,
    weight: Lanes<S>,
    hit: &BlockHit<S>,
    block: usize,
    geometry: &mut TileGeometry,
) {
    let add = |plane: &mut TilePlane, value: Lanes<S>| {
        let sum = &mut plane[block];
        (Lanes::load_array_ref(simd, sum) + value).store_array(sum);
    };
    add(&mut geometry.depth, weight * hit.per_denominator * splat.depth);
    let m = hit.denominator * (near / splat.depth);
    add(&mut geometry.moments[0], weight * m);
    add(&mut geometry.moments[1], weight * m * m);
    let (n, facing) = (splat.axes_in_camera[2], splat.facing());
    for k in 0..3 {
        add(&mut geometry.normal[k], weight * (facing * n[k]));
    }
}
