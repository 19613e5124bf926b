// Writes a pair for each splat and tile that it touches: splats in depth order, the tiles of a splat row by row
// (twin: gpu/tile_list_twin.rs). Counts the tiles' lowest digits for the sort.
// Workgroup: a block of BLOCK pairs. Invocation: every GROUP-th of the block, so that the tiles of a large splat are
// written side by side.

#constants
#include common/groups
#include common/step
#include common/status
#include common/projected
#include common/bounds
#include common/digit_counts

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> values_in: array<u32>; // [visible] splats in depth order
@group(0) @binding(3) var<storage, read> slot_offsets: array<u32>; // [visible] by rank
@group(0) @binding(4) var<storage, read> block_sums: array<u32>; // [num_blocks] first slots
@group(0) @binding(5) var<storage, read_write> bounds: array<Bounds>; // [n]
@group(0) @binding(6) var<storage, read_write> keys_out: array<u32>; // [num_pairs] tiles
@group(0) @binding(7) var<storage, read_write> slots: array<u32>; // [num_pairs] splats
@group(0) @binding(8) var<storage, read_write> histogram: array<u32>; // common/digit_counts

fn first_slot_of(rank: u32) -> u32 {
    return slot_offsets[rank] + block_sums[rank / BLOCK];
}

// The rank of the splat that a slot belongs to: the last one that begins at or before it. Rank 0 begins at slot 0, and where there
// is a slot there is a splat.
fn rank_of(slot: u32) -> u32 {
    var low = 0u;
    var high = status[step.status_slot].visible;
    while high - low > 1u {
        let middle = low + (high - low) / 2u;
        if first_slot_of(middle) <= slot {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// What `tile_run` needs. Other invocations may be writing the rest.
fn footprint_of(splat: u32) -> Bounds {
    var out = empty_bounds();
    out.centre_px = bounds[splat].centre_px;
    out.per_half_height = bounds[splat].per_half_height;
    out.shear = bounds[splat].shear;
    out.half_span_px = bounds[splat].half_span_px;
    out.rightmost_dy_px = bounds[splat].rightmost_dy_px;
    out.box_min = bounds[splat].box_min;
    out.box_max = bounds[splat].box_max;
    return out;
}

// The tile of a slot. The slots were counted by `project`, and a driver need not round the same way here: tiles beyond the
// count have no slot, and slots left over get a tile past the last one.
fn tile_of(splat: u32, first_slot: u32, slot: u32) -> u32 {
    let footprint = footprint_of(splat);
    let rows = tile_rows(footprint);
    var left = slot - first_slot;
    for (var row = rows.x; row < rows.y; row += 1) {
        let run = tile_run(footprint, row);
        let length = u32(run.y - run.x);
        if left < length {
            return u32(row) * step.grid.x + u32(run.x) + left;
        }
        left -= length;
    }
    // raster_bwd writes no sums for slots left over, and sum_pairs must not read them.
    if left == 0u {
        bounds[splat].num_tiles = slot - first_slot;
    }
    return step.grid.x * step.grid.y;
}

@compute @workgroup_size(GROUP)
fn tile_emit(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let block = group_index(id, groups);
    let count = status[step.status_slot].needed_pairs;
    clear_counts(lane);
    if block < blocks_of(count) {
        let past = block * BLOCK + min(count - block * BLOCK, BLOCK);
        for (var slot = block * BLOCK + lane; slot < past; slot += GROUP) {
            let rank = rank_of(slot);
            let splat = values_in[rank];
            let first_slot = first_slot_of(rank);
            if slot == first_slot {
                bounds[splat].first_slot = slot;
            }
            let tile = tile_of(splat, first_slot, slot);
            // `visible_sums` has found that needed_pairs is at most pair_capacity.
            keys_out[slot] = tile;
            slots[slot] = splat;
            count_digit(tile);
        }
    }
    store_counts(lane, block, blocks_of(count));
}
