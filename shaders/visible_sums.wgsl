// Place of each group's visible splats in the list of all, the total numbers of visible splats and of pairs, and the
// workgroup counts of every later dispatch of the step (no twin; tested in gpu/tile_list_tests.rs). If the pairs exceed the
// capacity, all counts become zero, so that nothing submitted after it is applied; but the step's flush is completed.
// One workgroup, dispatched directly: a dispatch must not read its size from a table that it writes. Invocation:
// LANE_ELEMENTS neighbouring groups at a time.

#constants
#include common/groups
#include common/step
#include common/status
#include common/scan
#include common/group_lists

@group(0) @binding(1) var<storage, read_write> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read_write> group_lists: array<u32>; // common/group_lists
@group(0) @binding(3) var<storage, read_write> args: array<u32>; // [NUM_GROUPS, 3] workgroups along x, y, z
@group(0) @binding(4) var<storage, read_write> visible: array<u32>; // [1 + n] number of visible splats, then these

@compute @workgroup_size(GROUP)
fn visible_sums(@builtin(local_invocation_index) lane: u32) {
    let count = splat_groups();
    var num_visible = 0u;
    var pairs = 0u;
    for (var block = 0u; block < count; block += BLOCK) {
        let first = block + lane * LANE_ELEMENTS;
        let past = min(first + LANE_ELEMENTS, count);
        var own = 0u;
        var own_pairs = 0u;
        for (var i = first; i < past; i += 1u) {
            own += group_lists[count_at(i)];
            own_pairs = add_saturating(own_pairs, group_lists[pairs_at(i)]);
        }
        let scan = scan_group(lane, own);
        own = num_visible + scan.before;
        for (var i = first; i < past; i += 1u) {
            let here = group_lists[count_at(i)];
            group_lists[count_at(i)] = own;
            own += here;
        }
        num_visible += scan.total;
        pairs = add_saturating(pairs, scan_group(lane, own_pairs).total);
    }
    if lane > 0u {
        return;
    }
    // An earlier step did not fit: the lists are stale, and all counts stay zero.
    if args[3u * GROUPS_ONE] == 0u {
        set_groups(GROUPS_LISTED_BLOCKS, 0u);
        set_groups(GROUPS_EACH_LISTED, 0u);
        return;
    }
    visible[0] = num_visible;
    status[step.status_slot].visible = num_visible;
    status[step.status_slot].needed_pairs = pairs;
    let fits = pairs <= step.pair_capacity;
    for (var i = 0u; i < 3u * NUM_GROUPS && !fits; i += 1u) {
        args[i] = 0u;
    }
    // `project` has flushed the SH of these splats: their texels must follow, whether the pairs fit or not.
    set_groups(GROUPS_LISTED_BLOCKS, blocks_of(num_visible));
    set_groups(GROUPS_EACH_LISTED, num_visible);
    if !fits {
        return;
    }
    let num_tiles = step.grid.x * step.grid.y;
    set_groups(GROUPS_ONE_LATER, 1u);
    set_groups(GROUPS_EACH_VISIBLE, num_visible);
    set_groups(GROUPS_VISIBLE, invocations(num_visible));
    set_groups(GROUPS_VISIBLE_BLOCKS, blocks_of(num_visible));
    set_groups(GROUPS_VISIBLE_DIGITS, scan_groups(num_visible));
    set_groups(GROUPS_PAIR_DIGITS, scan_groups(pairs));
    set_groups(GROUPS_TILES, num_tiles);
    set_groups(GROUPS_SEGMENTS, num_tiles + num_boundaries(pairs));
    set_groups(GROUPS_LOSS_TILES, num_loss_tiles());
    set_groups(GROUPS_PAIRS_AND_TILES, invocations(max(pairs, num_tiles)));
    set_groups(GROUPS_PAIR_BLOCKS, blocks_of(pairs));
    set_groups(GROUPS_VISIBLE_TOTALS, invocations(num_visible * step.partial_stride));
}

// Workgroups that provide `count` invocations.
fn invocations(count: u32) -> u32 {
    return (count + (GROUP - 1u)) / GROUP;
}

// Most boundaries between segments that tiles with this number of pairs in total can have: the highest number of one.
fn num_boundaries(pairs: u32) -> u32 {
    if step.segment_pairs == 0u {
        return 0u;
    }
    return (max(pairs, 1u) - 1u) / step.segment_pairs;
}

fn set_groups(entry: u32, groups: u32) {
    let folded = folded_groups(groups);
    args[3u * entry] = folded.x;
    args[3u * entry + 1u] = folded.y;
    args[3u * entry + 2u] = 1u;
}
