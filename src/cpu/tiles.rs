//! Lists the splats that touch each tile, in depth order.

use super::bounds::Bounds;
use super::math::BLOCK_PX;
use super::project::ProjectedSplat;
use super::simd::dispatch;
use super::tile::{BLOCK_COLS, BLOCK_ROWS, BlockSet, CPU_TILE_PX, blocks_of_row};
use fearless_simd::{Level, Simd};
use rayon::prelude::*;

/// The texels of a splat's map that a tile can touch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TexelWindow {
    pub row0: i32,
    pub col0: i32,
    pub rows: i32,
    pub cols: i32,
}

impl TexelWindow {
    pub(super) fn len(&self) -> usize {
        (self.rows * self.cols) as usize
    }
}

/// A pair of tile and splat.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pair {
    /// Index into the projected splats.
    pub splat: u32,
    /// The blocks that the splat may touch.
    pub blocks: BlockSet,
    /// Position of its partial sums, in floats from the first of all.
    pub partial: usize,
    pub window: TexelWindow,
}

/// Tile grid and pairs of a view.
#[derive(Default)]
pub(super) struct Tiles {
    /// Columns and rows of tiles.
    pub grid: [usize; 2],
    /// Pairs by tile, front to back.
    pub pairs: Vec<Pair>,
    /// First pair of each tile; the last entry is the number of pairs. `[tiles + 1]`
    pub tile_start: Vec<u32>,
    /// First slot of each projected splat; the last entry is the number of slots. `[splats + 1]`
    pub slot_start: Vec<u32>,
    /// Index of the pair in each slot; a splat has a slot per tile, row by row.
    pub slot_pair: Vec<u32>,
    /// Number of floats of all partial sums.
    pub partial_floats: usize,
}

/// A splat touches the tiles `tx0..tx1` of row `ty`.
#[derive(Clone, Copy)]
struct TileRun {
    ty: u16,
    tx0: u16,
    tx1: u16,
    /// Where the blocks of these tiles begin in those of the chunk.
    blocks: u32,
}

/// Lists the pairs of all tiles. `header_floats` is the fixed part of a pair's partial sums.
pub(super) fn build_tiles(
    level: Level,
    splats: &[ProjectedSplat],
    size_px: [u32; 2],
    header_floats: usize,
) -> Tiles {
    let grid = size_px.map(|s| (s as usize).div_ceil(CPU_TILE_PX));
    let runs: Vec<ChunkRuns> =
        splats.par_chunks(RUN_CHUNK).map(|chunk| dispatch!(level, simd => chunk_runs(simd, chunk))).collect();
    let runs_of = |splat: usize| runs[splat / RUN_CHUNK].of(splat % RUN_CHUNK);
    let mut slot_start = Vec::with_capacity(splats.len() + 1);
    let mut tile_start = vec![0_u32; grid[0] * grid[1] + 1];
    let mut slots = 0;
    slot_start.push(0);
    for splat in 0..splats.len() {
        for run in runs_of(splat) {
            slots += u32::from(run.tx1 - run.tx0);
            let row = usize::from(run.ty) * grid[0];
            (run.tx0..run.tx1).for_each(|tx| tile_start[row + usize::from(tx) + 1] += 1);
        }
        slot_start.push(slots);
    }
    for t in 1..tile_start.len() {
        tile_start[t] += tile_start[t - 1];
    }
    let mut order: Vec<(u32, u32)> =
        splats.iter().enumerate().map(|(i, s)| (s.depth.to_bits(), i as u32)).collect();
    order.par_sort_unstable();
    let mut pairs = vec![Pair::default(); slots as usize];
    let mut slot_pair = vec![0; slots as usize];
    let mut next = tile_start.clone();
    for (_, splat) in order {
        let mut slot = slot_start[splat as usize] as usize;
        let chunk = &runs[splat as usize / RUN_CHUNK];
        for run in runs_of(splat as usize) {
            let row = usize::from(run.ty) * grid[0];
            for (tx, blocks) in (run.tx0..run.tx1).zip(&chunk.blocks[run.blocks as usize..]) {
                let at = &mut next[row + usize::from(tx)];
                pairs[*at as usize] = Pair { splat, blocks: *blocks, ..Pair::default() };
                slot_pair[slot] = *at;
                *at += 1;
                slot += 1;
            }
        }
    }
    let mut tiles = Tiles { grid, pairs, tile_start, slot_start, slot_pair, partial_floats: 0 };
    tiles.place_partials(splats, header_floats);
    tiles
}

impl Tiles {
    /// First pixel of a tile.
    pub(super) fn origin_px(&self, tile: usize) -> [i32; 2] {
        [(tile % self.grid[0] * CPU_TILE_PX) as i32, (tile / self.grid[0] * CPU_TILE_PX) as i32]
    }

    /// Pairs of a tile, front to back.
    pub(super) fn pairs_of(&self, tile: usize) -> &[Pair] {
        &self.pairs[self.tile_start[tile] as usize..self.tile_start[tile + 1] as usize]
    }

    /// Number of tiles.
    pub(super) fn len(&self) -> usize {
        self.grid[0] * self.grid[1]
    }

    /// Sets texel window and position of the partial sums of each pair.
    fn place_partials(&mut self, splats: &[ProjectedSplat], header_floats: usize) {
        let mut next = 0;
        for tile in 0..self.len() {
            let origin = self.origin_px(tile);
            let range = self.tile_start[tile] as usize..self.tile_start[tile + 1] as usize;
            for pair in &mut self.pairs[range] {
                pair.window = texel_window(&splats[pair.splat as usize], origin);
                pair.partial = next;
                next += header_floats + 3 * pair.window.len();
            }
        }
        self.partial_floats = next;
    }
}

/// Splats per parallel job.
const RUN_CHUNK: usize = 256;

/// Tile runs of a chunk of splats.
struct ChunkRuns {
    runs: Vec<TileRun>,
    /// End of each splat's runs.
    ends: Vec<u32>,
    /// Blocks that the splat may touch in each tile of the runs.
    blocks: Vec<BlockSet>,
}

impl ChunkRuns {
    /// Runs of a splat of the chunk.
    fn of(&self, splat: usize) -> &[TileRun] {
        let start = if splat == 0 { 0 } else { self.ends[splat - 1] as usize };
        &self.runs[start..self.ends[splat] as usize]
    }
}

/// Inlined into the context of the instruction set, where rounding is an instruction instead of a call.
#[inline(always)]
fn chunk_runs<S: Simd>(_simd: S, splats: &[ProjectedSplat]) -> ChunkRuns {
    let mut out = ChunkRuns {
        runs: Vec::with_capacity(2 * splats.len()),
        ends: Vec::with_capacity(splats.len()),
        blocks: Vec::with_capacity(2 * splats.len()),
    };
    let tile = CPU_TILE_PX as i32;
    for splat in splats {
        let b = &splat.bounds;
        for ty in b.y0 / tile..=(b.y1 - 1) / tile {
            out.add_run(b, ty);
        }
        out.ends.push(out.runs.len() as u32);
    }
    out
}

impl ChunkRuns {
    /// Adds the tiles of row `ty` that a splat touches.
    #[inline(always)]
    fn add_run(&mut self, b: &Bounds, ty: i32) {
        let height = BLOCK_PX[1] as i32;
        let mut spans = [(0, 0); BLOCK_ROWS];
        let (mut first, mut past) = (i32::MAX, i32::MIN);
        for (row, span) in spans.iter_mut().enumerate() {
            let y = ty * CPU_TILE_PX as i32 + row as i32 * height;
            let (mut x0, mut x1) = (i32::MAX, i32::MIN);
            for y in y.max(b.y0)..(y + height).min(b.y1) {
                let row = b.row_span(y);
                if row.0 < row.1 {
                    (x0, x1) = (x0.min(row.0), x1.max(row.1));
                }
            }
            if x0 < x1 {
                *span = (x0 as usize / BLOCK_PX[0], (x1 - 1) as usize / BLOCK_PX[0] + 1);
                (first, past) = (first.min(x0), past.max(x1));
            }
        }
        if first >= past {
            return;
        }
        let [tx0, tx1] = [first as usize / CPU_TILE_PX, (past - 1) as usize / CPU_TILE_PX + 1];
        let blocks = self.blocks.len() as u32;
        self.runs.push(TileRun { ty: ty as u16, tx0: tx0 as u16, tx1: tx1 as u16, blocks });
        for tx in tx0..tx1 {
            let within = |col: usize| col.saturating_sub(tx * BLOCK_COLS).min(BLOCK_COLS);
            let rows = spans.iter().enumerate();
            let blocks = rows.map(|(row, span)| blocks_of_row(row, within(span.0)..within(span.1)));
            self.blocks.push(blocks.fold(0, |all, row| all | row));
        }
    }
}

/// For maps of up to this many texels the window is the whole map: finding a smaller one would cost more.
const WHOLE_MAP_TEXELS: i32 = 25;

/// The texels that the taps of a splat can touch within a tile. The map from pixels to texels is projective,
/// so its extremes over a rectangle lie at the corners as long as the denominator is positive there.
fn texel_window(splat: &ProjectedSplat, origin_px: [i32; 2]) -> TexelWindow {
    let map = &splat.map;
    let whole = TexelWindow { row0: 0, col0: 0, rows: map.rows, cols: map.cols };
    if map.rows * map.cols <= WHOLE_MAP_TEXELS {
        return whole;
    }
    let b = &splat.bounds;
    let tile = CPU_TILE_PX as i32;
    let x = [b.x0.max(origin_px[0]), b.x1.min(origin_px[0] + tile)].map(|v| v as f32 - splat.centre_px[0]);
    let y = [b.y0.max(origin_px[1]), b.y1.min(origin_px[1] + tile)].map(|v| v as f32 - splat.centre_px[1]);
    let mut low = [f32::INFINITY; 2];
    let mut high = [f32::NEG_INFINITY; 2];
    for corner in 0..4 {
        let (dx, dy) = (x[corner % 2], y[corner / 2]);
        let denominator = 1.0 + splat.g[0] * dx + splat.g[1] * dy;
        if denominator < 1e-2 {
            return whole;
        }
        let along = |numerator: [f32; 2]| (numerator[0] * dx + numerator[1] * dy) / denominator;
        let (a, b, texels) = (along(splat.a), along(splat.b), &map.texels_per_coordinate);
        for (k, texels_from_centre) in
            [texels.u_a * a, texels.v_a * a + texels.v_b * b].into_iter().enumerate()
        {
            let texel = texels_from_centre + map.origin[k];
            low[k] = low[k].min(texel);
            high[k] = high[k].max(texel);
        }
    }
    // 0.01 texels of slack for rounding.
    let range = |k: usize, size: i32| {
        let reach = map.footprint.reach[k] + 0.01;
        let first = ((low[k] - reach).ceil() as i32).clamp(0, size);
        let past = ((high[k] + reach).floor() as i32).saturating_add(1).clamp(first, size);
        (first, past - first)
    };
    let ((row0, rows), (col0, cols)) = (range(0, map.rows), range(1, map.cols));
    TexelWindow { row0, col0, rows, cols }
}
