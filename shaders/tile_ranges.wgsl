// Finds the range of each tile's pairs among the sorted pairs by binary search (twin: gpu/tile_list_twin.rs).
// Workgroup: GROUP tiles. Invocation: a tile.

#constants
#include common/groups
#include common/step
#include common/status

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> keys_in: array<u32>; // [num_pairs] tiles, ascending
@group(0) @binding(3) var<storage, read_write> ranges_out: array<vec2u>; // [num_tiles] first, past

@compute @workgroup_size(GROUP)
fn tile_ranges(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let tile = group_index(id, groups) * GROUP + lane;
    if tile >= step.grid.x * step.grid.y {
        return;
    }
    let first = lower_bound(tile, 0u);
    ranges_out[tile] = vec2u(first, lower_bound(tile + 1u, first));
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
