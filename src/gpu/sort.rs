//! Orders the kernels that turn bounds and depth keys into a list of pairs per tile, and computes the numbers that
//! they need from the host.
//!
//! Order within a step: `project`, [`visible_list`], `flush_texel`, [`depth_sort`], [`pair_slots`], [`tile_lists`]. `project` and
//! `visible_sums` take their workgroup counts from [`first_args`], which the host writes where no submission is under
//! way. The latter sets the counts of all later dispatches, or zeroes all counts if the pairs do not fit.
//!
//! A pass of the sort takes two dispatches: the kernels that emit keys count their lowest digits, and each pass counts those
//! of the next.

use super::device::UNIFORM_STRIDE;
use super::encode::Dispatch;
use super::kernels::{Groups, KernelId, NUM_GROUPS};
use super::layout::{DispatchArgs, SortPass};
use super::resources::UniformOffsets;
use super::shader::{BLOCK, DEPTH_KEY_BITS, DIGIT_BITS, GROUP, LANE_BLOCKS, MAX_GROUPS};

/// Passes of the sort by depth. Even, so that the result is in `KeysA` and `ValuesA`.
pub(super) const DEPTH_PASSES: u32 = DEPTH_KEY_BITS.div_ceil(DIGIT_BITS);
/// Largest number of passes of the sort by tile.
const MAX_TILE_PASSES: u32 = u32::BITS.div_ceil(DIGIT_BITS);

const _: () = assert!(DEPTH_PASSES.is_multiple_of(2), "the kernels after the sort by depth read ValuesA");

/// The table of sort passes, the same for every step: those by depth, those by tile that another follows, and the last ones
/// by tile after 0, 1, ... others.
pub(super) fn sort_passes() -> Vec<SortPass> {
    let pass = |index, counts_pairs: bool, is_last: bool| SortPass {
        shift: index * DIGIT_BITS,
        counts_pairs: u32::from(counts_pairs),
        // The values of pairs are their slots.
        identity_values: u32::from(counts_pairs && index == 0),
        counts_next: u32::from(!is_last),
    };
    let by_depth = (0..DEPTH_PASSES).map(|i| pass(i, false, i + 1 == DEPTH_PASSES));
    let by_tile = |is_last| (0..MAX_TILE_PASSES).map(move |i| pass(i, true, is_last));
    by_depth.chain(by_tile(false)).chain(by_tile(true)).collect()
}

/// Passes of the sort by tile. Keys go up to `num_tiles` inclusive, which means no tile.
pub(super) fn num_tile_passes(num_tiles: u32) -> u32 {
    (u32::BITS - num_tiles.leading_zeros()).div_ceil(DIGIT_BITS)
}

/// Entries of the histogram for sorts of up to `keys` keys: counts by digit and block, and by digit.
pub(super) fn histogram_entries(keys: u32) -> u64 {
    (u64::from(keys.div_ceil(BLOCK)) + 1) << DIGIT_BITS
}

/// Counts of the keys' lowest digits by block, which the kernels that emit keys make (`shaders/common/digit_counts.wgsl`); to
/// sort other keys.
pub(super) fn first_counts(keys: &[u32]) -> Vec<u32> {
    let mut out = vec![0; histogram_entries(keys.len() as u32) as usize];
    let num_blocks = keys.len().div_ceil(BLOCK as usize);
    for (block, keys) in keys.chunks(BLOCK as usize).enumerate() {
        for key in keys {
            out[(key % (1 << DIGIT_BITS)) as usize * num_blocks + block] += 1;
        }
    }
    out
}

/// Entries of the lists of visible splats by group (`shaders/common/group_lists.wgsl`).
pub(super) fn group_list_entries(splats: u64) -> u64 {
    splats.div_ceil(GROUP.into()) * (u64::from(GROUP) + 2)
}

/// Workgroups along x and y, at most [`MAX_GROUPS`] each (twin: `common/groups.wgsl`).
pub(super) fn folded_groups(groups: u32) -> DispatchArgs {
    let rows = groups.div_ceil(MAX_GROUPS).max(1);
    DispatchArgs { x: groups.div_ceil(rows), y: rows, z: 1 }
}

/// Workgroups of `sort_scan` (twin: `common/groups.wgsl`).
pub(super) fn scan_groups(keys: u32) -> u32 {
    if keys.div_ceil(BLOCK) > LANE_BLOCKS { 1 << DIGIT_BITS } else { 1 }
}

/// The table of indirect dispatches before the first step: all counts that depend on the view are zero.
pub(super) fn first_args(num_splats: u32) -> Vec<DispatchArgs> {
    let mut args = vec![DispatchArgs::default(); NUM_GROUPS as usize];
    args[Groups::One as usize] = folded_groups(1);
    args[Groups::Splats as usize] = folded_groups(num_splats.div_ceil(GROUP));
    args[Groups::EachSplat as usize] = folded_groups(num_splats);
    args
}

/// The table for [`depth_sort`] alone, of this many keys.
pub(super) fn sort_args(keys: u32) -> Vec<DispatchArgs> {
    let mut args = first_args(keys);
    args[Groups::VisibleBlocks as usize] = folded_groups(keys.div_ceil(BLOCK));
    args[Groups::VisibleDigits as usize] = folded_groups(scan_groups(keys));
    args
}

/// Lists the visible splats in `ValuesA` with their depths in `KeysA`, and sets the workgroup counts of later dispatches.
pub(super) fn visible_list(step: UniformOffsets) -> Vec<Dispatch> {
    [KernelId::VisibleSums, KernelId::ListVisible].map(|kernel| Dispatch::new(kernel, step)).to_vec()
}

/// Sorts the visible splats by depth key, then index; the order ends up in `ValuesA`.
pub(super) fn depth_sort(step: UniformOffsets) -> Vec<Dispatch> {
    (0..DEPTH_PASSES).flat_map(|i| pass(step, i, i, [Groups::VisibleDigits, Groups::VisibleBlocks])).collect()
}

/// Computes the slots of the pairs, and their tiles in `KeysA`.
pub(super) fn pair_slots(step: UniformOffsets) -> Vec<Dispatch> {
    [KernelId::PrefixBlocks, KernelId::PrefixSums, KernelId::TileEmit]
        .map(|kernel| Dispatch::new(kernel, step))
        .to_vec()
}

/// Sorts the pairs by tile, keeping the order by depth within each tile; the pairs end up in `Pairs`, and the range
/// of each tile in `TileRanges`.
pub(super) fn tile_lists(step: UniformOffsets, num_tiles: u32) -> Vec<Dispatch> {
    let passes = num_tile_passes(num_tiles);
    let entry = |i| DEPTH_PASSES + i + if i + 1 == passes { MAX_TILE_PASSES } else { 0 };
    let mut out: Vec<Dispatch> =
        (0..passes).flat_map(|i| pass(step, i, entry(i), [Groups::PairDigits, Groups::PairBlocks])).collect();
    // The table of kernels binds KeysB and ValuesB, where an odd number of passes ends.
    let swapped = passes.is_multiple_of(2);
    out.push(Dispatch { swapped, ..Dispatch::new(KernelId::GatherPairs, step) });
    out
}

/// All dispatches between `flush_texel` and `raster_fwd`.
pub(super) fn order_and_bin(step: UniformOffsets, num_tiles: u32) -> Vec<Dispatch> {
    [depth_sort(step), pair_slots(step), tile_lists(step, num_tiles)].concat()
}

/// Pass `index` of a sort, with entry `entry` of the table of sort passes and the workgroups of both kernels.
fn pass(step: UniformOffsets, index: u32, entry: u32, [scan, scatter]: [Groups; 2]) -> [Dispatch; 2] {
    let offsets = UniformOffsets { sort_pass: entry * UNIFORM_STRIDE as u32, ..step };
    [(KernelId::SortScan, scan), (KernelId::SortScatter, scatter)].map(|(kernel, groups)| Dispatch {
        kernel,
        groups,
        swapped: index % 2 == 1,
        offsets,
    })
}
