// Applies a density-control plan to one array of texels or moments: cuts each new map out of the texel grid of
// its source, or of a grid twice as fine or coarse, and scales it (twin: cpu/maps.rs). Outside the grid, values
// are zero, or with FLAG_NEAREST_OUTSIDE those of the nearest texel. Also copies the source's last step.
// Resampled maps are left to resample_maps.
// Workgroup: a new splat. Invocation: every SPLAT_GROUP-th float of its map.

#constants
#include common/groups
#include common/step
#include common/splat
#include common/map_change

@group(0) @binding(1) var<storage, read> changes: array<MapChange>; // [n_new]
@group(0) @binding(2) var<storage, read> old_info: array<SplatInfo>; // [n_old]
@group(0) @binding(3) var<storage, read_write> splat_info: array<SplatInfo>; // [n_new]
@group(0) @binding(4) var<storage, read> old_values: array<f32>; // [T_old, 3]
@group(0) @binding(5) var<storage, read_write> new_values: array<f32>; // [T_new, 3]
@group(0) @binding(6) var<storage, read> scales: array<f32>; // [n_new]

fn map_extent(map_size: u32) -> vec2i {
    return vec2i(vec2u(map_rows(map_size), map_cols(map_size)));
}

fn grid_extent(extent: vec2i, kind: u32) -> vec2i {
    let other = select(extent, 2 * extent, kind == CHANGE_FINER);
    return select(other, (extent + 3) / 4 * 2, kind == CHANGE_COARSER);
}

fn old_texel(old: SplatInfo, row: i32, col: i32, channel: u32) -> f32 {
    return old_values[3u * (old.map_offset_texels + u32(row) * map_cols(old.map_size) + u32(col)) + channel];
}

// The texels that contain the four quarters of a coarse texel, along one axis.
fn quarters(coarse: i32, texels: i32) -> vec4i {
    let padding = (4 - texels % 4) % 4;
    // A shift rounds down, below zero too.
    return clamp((vec4i(0, 1, 2, 3) + (4 * coarse - padding)) >> vec4u(1u), vec4i(0), vec4i(texels - 1));
}

// Adds in the order of the twin.
fn mean(v: vec4f) -> f32 {
    return ((v.x + v.y) + (v.z + v.w)) * 0.25;
}

fn grid_texel(old: SplatInfo, kind: u32, at: vec2i, channel: u32) -> f32 {
    let extent = map_extent(old.map_size);
    let rows = quarters(at.x, extent.x);
    let cols = quarters(at.y, extent.y);
    var means = vec4f();
    // A loop of zero rounds instead of a branch: drivers that execute both sides of a branch skip it.
    for (var k = 0; k < select(0, 4, kind == CHANGE_COARSER); k++) {
        means[k] = mean(vec4f(
            old_texel(old, rows[k], cols.x, channel),
            old_texel(old, rows[k], cols.y, channel),
            old_texel(old, rows[k], cols.z, channel),
            old_texel(old, rows[k], cols.w, channel),
        ));
    }
    if kind == CHANGE_COARSER {
        return mean(means);
    }
    let texel = at >> vec2u(select(0u, 1u, kind == CHANGE_FINER));
    return old_texel(old, texel.x, texel.y, channel);
}

@compute @workgroup_size(SPLAT_GROUP)
fn regrid_maps(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups);
    if i >= step.num_splats {
        return;
    }
    let change = changes[i];
    let old = old_info[change.source];
    let info = splat_info[i];
    let cols = map_cols(info.map_size);
    let last = max(grid_extent(map_extent(old.map_size), change.kind) - 1, vec2i(0));
    let is_empty = num_texels(old.map_size) == 0u;
    let num_floats = select(3u * num_texels(info.map_size), 0u, change.kind == CHANGE_RESAMPLE);
    for (var f = lane; f < num_floats; f += SPLAT_GROUP) {
        let at = vec2i(vec2u(f / 3u / cols, f / 3u % cols)) + vec2i(change.first_row, change.first_col);
        let nearest = clamp(at, vec2i(0), last);
        var value = 0.0;
        if !is_empty && (all(nearest == at) || has_flag(FLAG_NEAREST_OUTSIDE)) {
            value = grid_texel(old, change.kind, nearest, f % 3u) * scales[i];
        }
        new_values[3u * info.map_offset_texels + f] = value;
    }
    storageBarrier();
    if lane == 0u {
        splat_info[i].last_step = old.last_step;
    }
}
