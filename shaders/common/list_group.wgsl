// Lists the visible splats of a workgroup, in the order of the splats. Requires `group_lists` bound.

#include common/group_lists

var<workgroup> listed: array<atomic<u32>, GROUP / 32u>; // a bit per lane
// Sums of the lower and of the upper halves of the numbers of tiles: neither overflows.
var<workgroup> tile_halves: array<atomic<u32>, 2>;

// Called by all lanes, before any of them lists its splat.
fn clear_list(lane: u32) {
    if lane < GROUP / 32u {
        atomicStore(&listed[lane], 0u);
    }
    if lane < 2u {
        atomicStore(&tile_halves[lane], 0u);
    }
    workgroupBarrier();
}

// Called by all lanes; invisible splats touch no tile.
fn list_splat(group: u32, lane: u32, num_tiles: u32) {
    if num_tiles > 0u {
        atomicOr(&listed[lane / 32u], 1u << (lane % 32u));
        atomicAdd(&tile_halves[0], num_tiles & 0xffffu);
        atomicAdd(&tile_halves[1], num_tiles >> 16u);
    }
    workgroupBarrier();
    if group >= splat_groups() {
        return;
    }
    var before = 0u;
    var total = 0u;
    for (var k = 0u; k < GROUP / 32u; k += 1u) {
        let lanes = atomicLoad(&listed[k]);
        before += countOneBits(lanes & lanes_before(k, lane));
        total += countOneBits(lanes);
    }
    if num_tiles > 0u {
        group_lists[list_at(group) + before] = group * GROUP + lane;
    }
    if lane == 0u {
        let low = atomicLoad(&tile_halves[0]);
        let high = atomicLoad(&tile_halves[1]) + (low >> 16u);
        group_lists[count_at(group)] = total;
        // Saturates, as the sums over groups do.
        group_lists[pairs_at(group)] = select((high << 16u) | (low & 0xffffu), 0xffffffffu, high > 0xffffu);
    }
}
