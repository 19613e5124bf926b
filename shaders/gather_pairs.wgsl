// Writes the splat of each tile-splat pair in the sorted order, and to its slot the place in it, and finds the range of each
// tile's pairs by binary search (twin: gpu/tile_list_twin.rs). raster_fwd adds the pairs' texel windows, because it reads
// the splats anyway.
// Workgroup: GROUP pairs, and as many tiles. Invocation: a pair, and a tile.

#constants
#include common/groups
#include common/step
#include common/status

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> keys_in: array<u32>; // [num_pairs] tiles, ascending
@group(0) @binding(3) var<storage, read> values_in: array<u32>; // [num_pairs] slots, by tile
@group(0) @binding(4) var<storage, read_write> slots: array<u32>; // [num_pairs] splat, then place of the pair
@group(0) @binding(5) var<storage, read_write> pairs: array<u32>; // [3, pair_capacity] by tile, front to back
@group(0) @binding(6) var<storage, read_write> ranges_out: array<vec2u>; // [num_tiles] first, past

@compute @workgroup_size(GROUP)
fn gather_pairs(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = group_index(id, groups) * GROUP + lane;
    if i < status[step.status_slot].needed_pairs {
        let slot = values_in[i];
        pairs[i] = slots[slot];
        slots[slot] = i;
    }
    if i < step.grid.x * step.grid.y {
        let first = lower_bound(i, 0u);
        ranges_out[i] = vec2u(first, lower_bound(i + 1u, first));
    }
}

// First pair at or after `start` whose tile is at least `tile`.
fn lower_bound(tile: u32, start: u32) -> u32 {
    var low = start;
    var high = status[step.status_slot].needed_pairs;
    while low < high {
        let middle = low + (high - low) / 2u;
        if keys_in[middle] < tile {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}
