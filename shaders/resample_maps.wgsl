// Applies a density-control plan to one array of texels or moments: samples the source of each resampled map
// bilinearly, with its centre shifted and zeros outside, and scales the result (twin: cpu/maps.rs). All other
// maps are left to regrid_maps.
// Workgroup: a new splat. Invocation: every SPLAT_GROUP-th float of its map.

#constants
#include common/groups
#include common/step
#include common/splat
#include common/map_change

@group(0) @binding(1) var<storage, read> changes: array<MapChange>; // [n_new]
@group(0) @binding(2) var<storage, read> old_info: array<SplatInfo>; // [n_old]
@group(0) @binding(3) var<storage, read> splat_info: array<SplatInfo>; // [n_new]
@group(0) @binding(4) var<storage, read> old_values: array<f32>; // [T_old, 3]
@group(0) @binding(5) var<storage, read_write> new_values: array<f32>; // [T_new, 3]
@group(0) @binding(6) var<storage, read> scales: array<f32>; // [n_new]

fn old_texel(old: SplatInfo, texel: vec2i, channel: u32) -> f32 {
    let size = vec2i(i32(map_rows(old.map_size)), i32(map_cols(old.map_size)));
    if any(texel < vec2i(0)) || any(texel >= size) {
        return 0.0;
    }
    return old_values[3u * (old.map_offset_texels + u32(texel.x * size.y + texel.y)) + channel];
}

fn resampled(old: SplatInfo, coordinate: vec2f, channel: u32) -> f32 {
    // The texel size of an empty map may be zero.
    if old.map_size == 0u {
        return 0.0;
    }
    let old_size = vec2f(f32(map_rows(old.map_size)), f32(map_cols(old.map_size)));
    // Clamped, so that the conversion to integers cannot overflow.
    let first = vec2i(floor(clamp(coordinate, vec2f(-2.0), old_size + 1.0)));
    let f = coordinate - floor(coordinate);
    let upper = old_texel(old, first, channel) * (1.0 - f.y) + old_texel(old, first + vec2i(0, 1), channel) * f.y;
    let lower = old_texel(old, first + vec2i(1, 0), channel) * (1.0 - f.y)
        + old_texel(old, first + vec2i(1, 1), channel) * f.y;
    return upper * (1.0 - f.x) + lower * f.x;
}

@compute @workgroup_size(SPLAT_GROUP)
fn resample_maps(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups);
    if i >= step.num_splats {
        return;
    }
    let old = old_info[changes[i].source];
    let info = splat_info[i];
    let size = vec2u(map_rows(info.map_size), map_cols(info.map_size));
    let num_floats = select(0u, 3u * size.x * size.y, changes[i].kind == CHANGE_RESAMPLE);
    let ratio = info.texel_sizes / old.texel_sizes;
    let old_origin = vec2f(bitcast<f32>(changes[i].first_row), bitcast<f32>(changes[i].first_col));
    for (var k = lane; k < num_floats; k += SPLAT_GROUP) {
        let texel = vec2f(vec2u(k / 3u / size.y, k / 3u % size.y));
        let coordinate = (texel - info.map_origin) * ratio + old_origin;
        new_values[3u * info.map_offset_texels + k] = resampled(old, coordinate, k % 3u) * scales[i];
    }
}
