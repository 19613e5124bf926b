//! Orders the kernels that turn bounds and depth keys into a list of pairs per tile, and computes the numbers that
//! they need from the host.
//!
//! Order within a step: `project`, [`depth_sort`], [`pair_slots`], [`tile_lists`]. Dispatches up to and including
//! the kernel `prefix_sums` take their workgroup counts from [`first_args`], which the host writes once per
//! submission. That kernel sets the counts of all later dispatches, or zeroes all counts if the pairs do not fit.

use super::device::UNIFORM_STRIDE;
use super::encode::Dispatch;
use super::kernels::{Groups, KernelId, NUM_GROUPS};
use super::layout::{DispatchArgs, SortPass};
use super::resources::UniformOffsets;
use super::shader::{BLOCK, DEPTH_KEY_BITS, DIGIT_BITS, GROUP, MAX_GROUPS};

/// Passes of the sort by depth. Odd, so that the result is in `KeysB` and `ValuesB`.
pub(super) const DEPTH_PASSES: u32 = DEPTH_KEY_BITS.div_ceil(DIGIT_BITS);
/// Largest number of passes of the sort by tile.
const MAX_TILE_PASSES: u32 = u32::BITS.div_ceil(DIGIT_BITS);

const _: () = assert!(DEPTH_PASSES % 2 == 1, "the kernels after the sort by depth read ValuesB");

/// The table of sort passes: the same for every step.
pub(super) fn sort_passes() -> Vec<SortPass> {
    let pass = |counts_pairs| {
        move |index| SortPass {
            shift: index * DIGIT_BITS,
            counts_pairs,
            identity_values: u32::from(index == 0),
            pad: 0,
        }
    };
    (0..DEPTH_PASSES).map(pass(0)).chain((0..MAX_TILE_PASSES).map(pass(1))).collect()
}

/// Passes of the sort by tile. Keys go up to `num_tiles` inclusive, which means no tile.
pub(super) fn num_tile_passes(num_tiles: u32) -> u32 {
    (u32::BITS - num_tiles.leading_zeros()).div_ceil(DIGIT_BITS)
}

/// Entries of the histogram for sorts of up to `keys` keys.
pub(super) fn histogram_entries(keys: u32) -> u64 {
    u64::from(keys.div_ceil(BLOCK)) << DIGIT_BITS
}

/// Workgroups along x and y, at most [`MAX_GROUPS`] each (twin: `common/groups.wgsl`).
pub(super) fn folded_groups(groups: u32) -> DispatchArgs {
    let rows = groups.div_ceil(MAX_GROUPS).max(1);
    DispatchArgs { x: groups.div_ceil(rows), y: rows, z: 1 }
}

/// The table of indirect dispatches at the start of a submission: all counts that depend on pairs are zero.
pub(super) fn first_args(num_splats: u32) -> Vec<DispatchArgs> {
    let mut args = vec![DispatchArgs::default(); NUM_GROUPS as usize];
    args[Groups::One as usize] = folded_groups(1);
    args[Groups::Splats as usize] = folded_groups(num_splats.div_ceil(GROUP));
    args[Groups::SplatBlocks as usize] = folded_groups(num_splats.div_ceil(BLOCK));
    args[Groups::EachSplat as usize] = folded_groups(num_splats);
    args
}

/// Sorts all splats by depth key, then index; the order ends up in `ValuesB`.
pub(super) fn depth_sort(step: UniformOffsets) -> Vec<Dispatch> {
    (0..DEPTH_PASSES).flat_map(|i| pass(step, i, i, [Groups::SplatBlocks, Groups::One])).collect()
}

/// Computes the slots of the pairs, the workgroup counts of later dispatches, and the pairs' tiles in `KeysA`.
pub(super) fn pair_slots(step: UniformOffsets) -> Vec<Dispatch> {
    [KernelId::PrefixBlocks, KernelId::PrefixSums, KernelId::TileEmit]
        .map(|kernel| Dispatch::new(kernel, step))
        .to_vec()
}

/// Sorts the pairs by tile, keeping the order by depth within each tile; the pairs end up in `Pairs`, and the range
/// of each tile in `TileRanges`.
pub(super) fn tile_lists(step: UniformOffsets, num_tiles: u32) -> Vec<Dispatch> {
    let passes = num_tile_passes(num_tiles);
    let groups = [Groups::PairBlocks, Groups::OneLater];
    let mut out: Vec<Dispatch> = (0..passes).flat_map(|i| pass(step, i, DEPTH_PASSES + i, groups)).collect();
    // The table of kernels binds KeysB and ValuesB, where an odd number of passes ends.
    let swapped = passes.is_multiple_of(2);
    out.extend(
        [KernelId::TileRanges, KernelId::GatherPairs]
            .map(|kernel| Dispatch { swapped, ..Dispatch::new(kernel, step) }),
    );
    out
}

/// All dispatches between `project` and `raster_fwd`.
pub(super) fn order_and_bin(step: UniformOffsets, num_tiles: u32) -> Vec<Dispatch> {
    [depth_sort(step), pair_slots(step), tile_lists(step, num_tiles)].concat()
}

/// Pass `index` of a sort, with entry `entry` of the table of sort passes.
fn pass(step: UniformOffsets, index: u32, entry: u32, [blocks, one]: [Groups; 2]) -> [Dispatch; 3] {
    let offsets = UniformOffsets { sort_pass: entry * UNIFORM_STRIDE as u32, ..step };
    [(KernelId::SortCount, blocks), (KernelId::SortScan, one), (KernelId::SortScatter, blocks)]
        .map(|(kernel, groups)| Dispatch { kernel, groups, swapped: index % 2 == 1, offsets })
}
