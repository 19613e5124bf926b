// First slot of each block of splats, the total number of pairs, and the workgroup counts of every later
// dispatch of the step (no twin; tested in gpu/tile_list_tests.rs). If the pairs exceed the capacity, all
// counts become zero, so that nothing further in the submission is applied.
// One workgroup, dispatched directly: a dispatch must not read its size from a table that it writes. Invocation:
// LANE_ELEMENTS neighbouring blocks at a time.

#constants
#include common/groups
#include common/step
#include common/status
#include common/scan

@group(0) @binding(1) var<storage, read_write> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read_write> block_sums: array<u32>; // [num_blocks]
@group(0) @binding(3) var<storage, read_write> args: array<u32>; // [NUM_GROUPS, 3] workgroups along x, y, z

@compute @workgroup_size(GROUP)
fn prefix_sums(@builtin(local_invocation_index) lane: u32) {
    let count = blocks_of(step.num_splats);
    var total = 0u;
    for (var block = 0u; block < count; block += BLOCK) {
        let first = block + lane * LANE_ELEMENTS;
        let past = min(first + LANE_ELEMENTS, count);
        var sum = 0u;
        for (var i = first; i < past; i += 1u) {
            sum = add_saturating(sum, block_sums[i]);
        }
        let scan = scan_group(lane, sum);
        sum = add_saturating(total, scan.before);
        for (var i = first; i < past; i += 1u) {
            let here = block_sums[i];
            block_sums[i] = sum;
            sum = add_saturating(sum, here);
        }
        total = add_saturating(total, scan.total);
    }
    // An earlier step of the submission did not fit: the block sums are stale, and all counts stay zero.
    if lane > 0u || args[3u * GROUPS_ONE] == 0u {
        return;
    }
    status[step.status_slot].needed_pairs = total;
    if total > step.pair_capacity {
        for (var i = 0u; i < 3u * NUM_GROUPS; i += 1u) {
            args[i] = 0u;
        }
        return;
    }
    let num_tiles = step.grid.x * step.grid.y;
    set_groups(GROUPS_ONE_LATER, 1u);
    set_groups(GROUPS_EACH_SPLAT_LATER, step.num_splats);
    set_groups(GROUPS_SPLATS_LATER, invocations(step.num_splats));
    set_groups(GROUPS_TILES, num_tiles);
    set_groups(GROUPS_LOSS_TILES, num_loss_tiles());
    set_groups(GROUPS_TILE_INVOCATIONS, invocations(num_tiles));
    set_groups(GROUPS_PAIRS, invocations(total));
    set_groups(GROUPS_PAIR_BLOCKS, blocks_of(total));
    set_groups(GROUPS_SPLAT_TOTALS, invocations(step.num_splats * step.partial_stride));
}

// Workgroups that provide `count` invocations.
fn invocations(count: u32) -> u32 {
    return (count + (GROUP - 1u)) / GROUP;
}

fn set_groups(entry: u32, groups: u32) {
    let folded = folded_groups(groups);
    args[3u * entry] = folded.x;
    args[3u * entry + 1u] = folded.y;
    args[3u * entry + 2u] = 1u;
}
