// The pairs of a tile that raster_bwd sums, and what it does before and after. Requires `partials` bound.

#if STATISTICS
#if GEOMETRY
const NUM_SUMS = PAIR_SUMS_GEOMETRY;
#else
const NUM_SUMS = PAIR_SUMS_STATISTICS;
#endif
#else
const NUM_SUMS = PAIR_SUMS;
#endif

var<workgroup> last: atomic<u32>;
var<workgroup> end: u32;
var<workgroup> num_faults: atomic<u32>;

// The first of the tile's pairs whose sums there is room for, and one past the last. If they are the tile's last ones, those
// before are left out; otherwise those behind only pass on the state of the pixels.
fn summed_pairs(range: vec2u) -> vec2u {
    return vec2u(max(range.x, step.partial_first), min(range.y, step.partial_first + step.partial_capacity));
}

// One past the last pair that a pixel has blended. Zeroes the sums of those behind, and the faults. Has barriers.
fn used_pairs(summed: vec2u, first: u32, pixel_end: u32, lane: u32) -> u32 {
    if lane == 0u {
        atomicStore(&last, first);
        atomicStore(&num_faults, 0u);
    }
    workgroupBarrier();
    atomicMax(&last, pixel_end);
    workgroupBarrier();
    if lane == 0u {
        end = atomicLoad(&last);
    }
    let used = workgroupUniformLoad(&end);
    let idle = max(used, summed.x) - step.partial_first;
    for (var k = idle * NUM_SUMS + lane; k < (summed.y - step.partial_first) * NUM_SUMS; k += RASTER_GROUP) {
        // In bounds: summed.y lies at most partial_capacity behind partial_first.
        partials[k] = 0.0;
    }
    return used;
}

// Adds up the faults. The host needs only the total: the first of the summed pairs carries it; there is one. Has barriers.
fn store_faults(first_summed: u32, faults: u32, lane: u32) {
    atomicAdd(&num_faults, faults);
    storageBarrier();
    workgroupBarrier();
    if lane == 0u {
        partials[(first_summed - step.partial_first) * NUM_SUMS + SUM_FAULTS] = f32(atomicLoad(&num_faults));
    }
}
