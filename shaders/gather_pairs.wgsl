// Writes slot and splat of each tile-splat pair in the sorted order (twin: gpu/tile_list_twin.rs). raster_fwd
// adds the pairs' texel windows, because it reads the splats anyway.
// Workgroup: GROUP pairs. Invocation: a pair.

#constants
#include common/groups
#include common/step
#include common/status

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> values_in: array<u32>; // [num_pairs] slots, by tile
@group(0) @binding(3) var<storage, read> slot_splat: array<u32>; // [num_pairs]
@group(0) @binding(4) var<storage, read_write> pairs: array<vec2u>; // [2, pair_capacity] by tile, front to back

@compute @workgroup_size(GROUP)
fn gather_pairs(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let i = group_index(id, groups) * GROUP + lane;
    if i >= status[step.status_slot].needed_pairs {
        return;
    }
    let slot = values_in[i];
    pairs[i] = vec2u(slot, slot_splat[slot]);
}
