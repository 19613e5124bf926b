// Applies a density-control plan to one array of texels or moments: cuts each new map out of the texel grid of its source, or
// along each axis out of one twice as fine or coarse, and scales it (twin: cpu/maps.rs). Outside the grid, values are zero, or
// with FLAG_SECOND_MOMENTS those of the nearest texel. Also copies the source's last step. Resampled maps are left to
// resample_maps.
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

// Where a row (or column) of a window comes from: the two rows of the map whose mean it is, clamped to the map, and
// whether any of them was inside. Twice the same row unless the grid is coarser.
struct Place {
    pair: vec2i,
    is_inside: bool,
}

fn place(grid: u32, i: i32, first: i32, count: u32) -> Place {
    var pair = vec2i(first + i);
    if grid == CHANGE_FINER {
        // A shift rounds down, below zero too.
        pair = pair >> vec2u(1u);
    } else if grid == CHANGE_COARSER {
        pair = vec2i(first + 2 * i, first + 2 * i + 1);
    }
    let last = i32(count) - 1;
    return Place(clamp(pair, vec2i(0), vec2i(last)), pair.y >= 0 && pair.x <= last);
}

fn old_texel(old: SplatInfo, row: i32, col: i32, channel: u32) -> f32 {
    return old_values[3u * (old.map_offset_texels + u32(row) * map_cols(old.map_size) + u32(col)) + channel];
}

// Of one texel, the mean is that texel. Adds in the order of the twin.
fn mean(old: SplatInfo, rows: vec2i, cols: vec2i, channel: u32) -> f32 {
    let upper = old_texel(old, rows.x, cols.x, channel) + old_texel(old, rows.x, cols.y, channel);
    let lower = old_texel(old, rows.y, cols.x, channel) + old_texel(old, rows.y, cols.y, channel);
    return (upper + lower) * 0.25;
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
    let is_empty = num_texels(old.map_size) == 0u;
    let num_floats = select(3u * num_texels(info.map_size), 0u, change.kind == CHANGE_RESAMPLE);
    for (var f = lane; f < num_floats; f += SPLAT_GROUP) {
        let row = place(change.kind & 255u, i32(f / 3u / cols), change.first_row, map_rows(old.map_size));
        let col = place((change.kind >> 8u) & 255u, i32(f / 3u % cols), change.first_col, map_cols(old.map_size));
        var value = 0.0;
        if !is_empty && ((row.is_inside && col.is_inside) || has_flag(FLAG_SECOND_MOMENTS)) {
            value = mean(old, row.pair, col.pair, f % 3u) * scales[i];
        }
        new_values[3u * info.map_offset_texels + f] = value;
    }
    storageBarrier();
    if lane == 0u {
        splat_info[i].last_step = old.last_step;
    }
}
