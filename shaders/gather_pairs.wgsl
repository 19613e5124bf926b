// The sorted pairs: slot, splat, and the window of its texels that the tile can touch.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/status
#include common/splat
#include common/projected
#include common/tile
#include common/texel_window

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> keys_in: array<u32>; // [num_pairs] tiles, sorted
@group(0) @binding(3) var<storage, read> values_in: array<u32>; // [num_pairs] slots, by tile
@group(0) @binding(4) var<storage, read> slot_splat: array<u32>; // [num_pairs]
@group(0) @binding(5) var<storage, read> projected: array<Projected>; // [n]
@group(0) @binding(6) var<storage, read_write> pairs: array<Pair>; // [num_pairs]

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
    let splat = slot_splat[slot];
    let window = texel_window(projected[splat], tile_origin_px(keys_in[i]));
    pairs[i] = Pair(slot, splat, pack_px(vec2i(window.first)), pack_px(vec2i(window.past)));
}
