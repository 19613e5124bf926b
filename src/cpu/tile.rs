//! A tile of pixels and its blocks.

use super::math::{BLOCK_PX, LANES};
use std::ops::Range;

/// Edge of a tile. Larger than on GPUs: each pair costs set-up and partial sums, while rows outside a splat cost
/// nothing here (measured: 32 beats 16 on fox at 270x480).
pub(super) const CPU_TILE_PX: usize = 32;

/// Columns of blocks.
pub(super) const BLOCK_COLS: usize = CPU_TILE_PX / BLOCK_PX[0];

/// Rows of blocks.
pub(super) const BLOCK_ROWS: usize = CPU_TILE_PX / BLOCK_PX[1];

/// Blocks of a tile.
pub(super) const BLOCKS: usize = BLOCK_COLS * BLOCK_ROWS;

/// A value per pixel of a tile, by block.
pub(super) type TilePlane = [[f32; LANES]; BLOCKS];

/// Blocks of a tile, a bit each.
pub(super) type BlockSet = u64;

const _: () = assert!(BLOCKS == BlockSet::BITS as usize);

/// The blocks of a row of blocks, in these columns.
#[inline(always)]
pub(super) fn blocks_of_row(row: usize, cols: Range<usize>) -> BlockSet {
    ((1 << cols.end) - (1 << cols.start)) << (BLOCK_COLS * row)
}

/// Takes the first block out of a set that is not empty.
#[inline(always)]
pub(super) fn take_first(set: &mut BlockSet) -> usize {
    let block = set.trailing_zeros() as usize;
    *set &= *set - 1;
    block
}

/// Block and lane of pixel (x, y).
pub(super) fn place_of(x: usize, y: usize) -> (usize, usize) {
    let block = y / BLOCK_PX[1] * BLOCK_COLS + x / BLOCK_PX[0];
    (block, (y % BLOCK_PX[1]) * BLOCK_PX[0] + x % BLOCK_PX[0])
}
