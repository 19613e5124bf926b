// First slot of each splat's pairs relative to its block: exclusive prefix sums of the tile counts, in depth order,
// within blocks of BLOCK visible splats (no twin; tested in gpu/tile_list_tests.rs). prefix_sums adds the blocks.
// Workgroup: a block. Invocation: LANE_ELEMENTS neighbouring splats.

#constants
#include common/groups
#include common/step
#include common/status
#include common/projected
#include common/bounds
#include common/scan

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> values_in: array<u32>; // [visible] splats in depth order
@group(0) @binding(3) var<storage, read> bounds: array<Bounds>; // [n]
@group(0) @binding(4) var<storage, read_write> slot_offsets: array<u32>; // [visible] by rank
@group(0) @binding(5) var<storage, read_write> block_sums: array<u32>; // [num_blocks]

@compute @workgroup_size(GROUP)
fn prefix_blocks(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let block = group_index(id, groups);
    let n = status[step.status_slot].visible;
    let first = block * BLOCK + lane * LANE_ELEMENTS;
    var past = 0u;
    if block < blocks_of(n) {
        past = min(first + LANE_ELEMENTS, n);
    }
    var sum = 0u;
    for (var rank = first; rank < past; rank += 1u) {
        sum += bounds[values_in[rank]].num_tiles;
    }
    let scan = scan_group(lane, sum);
    sum = scan.before;
    for (var rank = first; rank < past; rank += 1u) {
        slot_offsets[rank] = sum;
        sum += bounds[values_in[rank]].num_tiles;
    }
    if lane == 0u && block < blocks_of(n) {
        block_sums[block] = scan.total;
    }
}
