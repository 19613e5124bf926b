// Lists the visible splats of all groups one after the other, with their depth keys, and counts the keys' lowest digits
// for the sort (no twin; tested in gpu/tile_list_tests.rs).
// Workgroup: a block of BLOCK visible splats. Invocation: every GROUP-th of the block.

#constants
#include common/groups
#include common/step
#include common/status
#include common/projected
#include common/bounds
#include common/group_lists
#include common/digit_counts

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> group_lists: array<u32>; // common/group_lists
@group(0) @binding(3) var<storage, read> bounds: array<Bounds>; // [n]
@group(0) @binding(4) var<storage, read_write> keys_out: array<u32>; // [visible] depth
@group(0) @binding(5) var<storage, read_write> values_out: array<u32>; // [visible] splats
@group(0) @binding(6) var<storage, read_write> histogram: array<u32>; // common/digit_counts
@group(0) @binding(7) var<storage, read_write> visible: array<u32>; // [1 + n] number of visible splats, then these, ascending

// The group that holds a place of the list: the last one that begins at or before it.
fn group_of(place: u32) -> u32 {
    var low = 0u;
    var high = splat_groups();
    while high - low > 1u {
        let middle = low + (high - low) / 2u;
        if group_lists[count_at(middle)] <= place {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

@compute @workgroup_size(GROUP)
fn list_visible(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let block = group_index(id, groups);
    let count = status[step.status_slot].visible;
    clear_counts(lane);
    if block < blocks_of(count) {
        let past = block * BLOCK + min(count - block * BLOCK, BLOCK);
        for (var place = block * BLOCK + lane; place < past; place += GROUP) {
            let group = group_of(place);
            let splat = group_lists[list_at(group) + place - group_lists[count_at(group)]];
            let key = bounds[splat].depth_key;
            keys_out[place] = key;
            values_out[place] = splat;
            visible[1u + place] = splat;
            count_digit(key);
        }
    }
    store_counts(lane, block, blocks_of(count));
}
