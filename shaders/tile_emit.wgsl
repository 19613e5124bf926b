// A pair per splat and tile that it touches: splats in depth order, a splat's tiles row by row.

#constants
#include common/groups
#include common/step
#include common/projected
#include common/bounds

@group(0) @binding(1) var<storage, read> values_in: array<u32>; // [n] splats in depth order
@group(0) @binding(2) var<storage, read> slot_offsets: array<u32>; // [n] by rank
@group(0) @binding(3) var<storage, read> block_sums: array<u32>; // [num_blocks] first slots
@group(0) @binding(4) var<storage, read_write> bounds: array<Bounds>; // [n]
@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>; // [num_pairs] tiles
@group(0) @binding(6) var<storage, read_write> slot_splat: array<u32>; // [num_pairs]

@compute @workgroup_size(GROUP)
fn tile_emit(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let rank = group_index(id, groups) * GROUP + lane;
    if rank >= step.num_splats {
        return;
    }
    let splat = values_in[rank];
    let shape = bounds[splat];
    let first_slot = slot_offsets[rank] + block_sums[rank / BLOCK];
    var slot = first_slot;
    bounds[splat].first_slot = slot;
    // Slots were counted by another kernel, whose rounding a driver need not repeat: no tile beyond them, and
    // those left over go to no tile.
    let past = slot + shape.num_tiles;
    let rows = tile_rows(shape);
    for (var row = rows.x; row < rows.y; row += 1) {
        let run = tile_run(shape, row);
        for (var column = run.x; column < run.y && slot < past; column += 1) {
            keys_out[slot] = u32(row) * step.grid.x + u32(column);
            slot_splat[slot] = splat;
            slot += 1u;
        }
    }
    // Nobody writes the sums of those: they are not added up.
    bounds[splat].num_tiles = slot - first_slot;
    for (; slot < past; slot += 1u) {
        keys_out[slot] = step.grid.x * step.grid.y;
        slot_splat[slot] = splat;
    }
}
