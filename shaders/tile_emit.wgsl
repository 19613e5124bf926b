// Writes a pair for each splat and tile that it touches: splats in depth order, the tiles of a splat row by row
// (twin: gpu/tile_list_twin.rs).
// Workgroup: GROUP splats. Invocation: a splat.

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
    let footprint = bounds[splat];
    let first_slot = slot_offsets[rank] + block_sums[rank / BLOCK];
    var slot = first_slot;
    bounds[splat].first_slot = slot;
    // The slots were counted by `project`, and a driver need not round the same way here: tiles beyond the count are
    // dropped, and slots left over get a tile past the last one.
    let past = slot + footprint.num_tiles;
    let rows = tile_rows(footprint);
    for (var row = rows.x; row < rows.y; row += 1) {
        let run = tile_run(footprint, row);
        for (var column = run.x; column < run.y && slot < past; column += 1) {
            keys_out[slot] = u32(row) * step.grid.x + u32(column);
            slot_splat[slot] = splat;
            slot += 1u;
        }
    }
    // raster_bwd writes no sums for slots left over, and sum_pairs must not read them.
    bounds[splat].num_tiles = slot - first_slot;
    for (; slot < past; slot += 1u) {
        keys_out[slot] = step.grid.x * step.grid.y;
        slot_splat[slot] = splat;
    }
}
