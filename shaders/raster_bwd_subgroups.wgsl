// What raster_bwd computes, by the invocations of subgroups together (twin: reference/raster_bwd.rs; method 2.4): for hardware
// all of whose subgroups have the same size.
// Workgroup: a segment of a tile's pairs; with GEOMETRY a tile. Invocation: a pixel, then a sum.
//
// Splats come in batches. Each patch of 8 x 4 pixels visits those whose boxes touch it, back to front; SUM_LANES of its pixels
// sum each quantity by exchanges between lanes, and store the sums in workgroup memory. Then the sums of all lanes are added in a
// fixed order: two barriers per batch, not two per splat. A pair's sums go to its place in `partials`, which holds those
// of `partial_capacity` pairs from `partial_first` on. Texel gradients are summed over the same pixels, or scattered, and
// added to memory in fixed point; the unit is that of the splat's whole box.
//
// STATISTICS: also the sums for the window statistics.
// GEOMETRY (with STATISTICS): also the distortion and normal terms.
// COUNT: counts global atomics instead of faults.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/splat
#include common/projected
#include common/tile
#include common/hit
#include common/fixed
#include common/texel_grad
#include common/pair_sums
#include common/replay
#include common/segments
#include common/tile_pairs
#include common/lane_sums
#include common/texel_sums
#include common/visits

@group(0) @binding(1) var<storage, read> projected: array<Projected>; // [n]
@group(0) @binding(2) var<storage, read> pairs: array<u32>; // [pair_capacity] by tile, front to back; states of pixels
@group(0) @binding(3) var<storage, read> tile_ranges: array<vec2u>; // [tiles] of pairs
@group(0) @binding(4) var<storage, read> texel_values: array<vec4f>; // [T] residual rgb
#if GEOMETRY
@group(0) @binding(5) var<storage, read> normals: array<vec4f>; // [n] camera axes, facing the camera
// [P, 3] by rgb, loss; constant, linear, square, transmittance; towards x, y, z, number of pairs (geometry_loss)
@group(0) @binding(6) var<storage, read> pixel_records: array<vec4f>;
#else
@group(0) @binding(5) var<storage, read> pixel_state: array<vec2u>; // [P] transmittance, one past the last blended pair
@group(0) @binding(6) var<storage, read> pixel_grad: array<vec4f>; // [P] by rgb; loss of the pixel
#endif
@group(0) @binding(7) var<storage, read_write> partials: array<f32>; // [partial_capacity, partial_stride] by place from partial_first on
@group(0) @binding(8) var<storage, read_write> texel_grad: array<atomic<i32>>; // [T, 3] fixed point

// The sums of a pair without the faults.
const NUM_VALUES = NUM_SUMS - 1u;
// Sums over SUM_LANES pixels that make up one of a tile, and one of a patch.
const NUM_PARTS = RASTER_GROUP / SUM_LANES;
const PATCH_PARTS = PATCH_LANES / SUM_LANES;
// As many splats as fit: with the rest, 16 KiB of workgroup memory.
const BATCH = min(32u, 3968u / (NUM_PARTS * NUM_VALUES));
// Two batches, so that one can be cleared while the other is in use.
const NUM_VISITS = 2u * NUM_PATCHES;

var<workgroup> batch: array<u32, BATCH>;
// Of patches that a splat does not touch, undefined.
var<workgroup> part_sums: array<f32, NUM_PARTS * BATCH * NUM_VALUES>;

// The first of the sums of a part and a splat of the batch.
fn part_sums_at(part: u32, k: u32) -> u32 {
    return (part * BATCH + k) * NUM_VALUES;
}

// Stores the lane's sums, from sum `first` on; SUMS_PER_LANE is at most 4.
fn store_sums(at: u32, first: u32, sums: vec4f, subgroup_lane: u32) {
    for (var j = 0u; j < SUMS_PER_LANE; j += 1u) {
        let sum = first + subgroup_lane % SUM_LANES * SUMS_PER_LANE + j;
        if subgroup_lane % SUM_LANES < SUMMING_LANES && sum < NUM_VALUES {
            part_sums[at + sum] = sums[j];
        }
    }
}

// A pixel, which its invocation keeps while it visits splats.
struct Visitor {
    pixel: vec2u,
    subgroup_lane: u32,
    // The place of its lanes' sums, below NUM_PARTS.
    part: u32,
    loss: f32,
}

// Puts a pixel into its state at the boundary before a pair, behind which it has blended others: raster_fwd stored it. Not with
// GEOMETRY.
fn begin_at(replay: ptr<function, Replay>, boundary: u32, lane: u32) {
    let there = load_state(boundary, lane);
    (*replay).behind = dot((*replay).by_rgb, there.rgb);
    (*replay).transmittance = there.a;
    (*replay).end = boundary;
}

// The splat of a batch whose pair is `index`, for the lanes of a patch; k is below BATCH. Not `summed`: only the state of
// the pixels goes on.
fn visit(replay: ptr<function, Replay>, visitor: Visitor, k: u32, index: u32, summed: bool) {
    let s = projected[subgroupBroadcastFirst(batch[k])];
    let hit = splat_hit(s, vec2f(visitor.pixel) + 0.5);
    let blended = is_blended(replay, s, index, hit, visitor.pixel);
    let at = part_sums_at(visitor.part, k);
    let lane = visitor.subgroup_lane;
    if !subgroupAny(blended) {
        for (var sum = 0u; sum < NUM_VALUES; sum += MAX_LANE_SUMS) {
            store_sums(at, sum, vec4f(0.0), lane);
        }
        return;
    }
    let taps = texture_taps(s, hit.plane);
    var by = SampleGradient();
    if blended {
        by = sample_bwd(replay, s, index, hit, taps);
    }
    if !summed {
        return;
    }
    (*replay).faults += add_texels(s, taps, by.by_colour, blended, lane);
    let offset = hit.offset_px;
    let u = by.by_hit.x * vec3f(1.0, offset);
    let v = by.by_hit.y * vec3f(1.0, offset);
    let d = by.by_hit.z * vec3f(1.0, offset);
    let exponent = by.by_falloff * s.opacity * vec3f(by.plane.x * by.plane, by.plane.y * by.plane.y);
    // In the order of pair_sums.
    let values = mat4x4f(
        vec4f(u, v.x), vec4f(v.yz, d.xy), vec4f(d.z, exponent), vec4f(by.by_falloff, by.by_colour),
    );
    store_sums(at, 0u, lane_sums(values, lane), lane);
#if STATISTICS
    let statistics = vec3f(f32(by.weight > 0.0), by.weight, by.weight * visitor.loss);
#if GEOMETRY
    let by_depth = by.by_m * s.near_over_depth * hit.denominator;
    let by_normal = by.weight * (*replay).towards;
    let others = mat4x4f(vec4f(statistics, by_depth), vec4f(by_normal, 0.0), vec4f(0.0), vec4f(0.0));
#else
    let others = mat4x4f(vec4f(statistics, 0.0), vec4f(0.0), vec4f(0.0), vec4f(0.0));
#endif
    store_sums(at, MAX_LANE_SUMS, lane_sums(others, lane), lane);
#endif
}

// A sum, below NUM_VALUES, of a splat of the batch, over the parts of the patches that it touches.
fn tile_sum(first_visits: u32, k: u32, sum: u32) -> f32 {
    var total = 0.0;
    for (var part = 0u; part < NUM_PARTS; part += 1u) {
        if (atomicLoad(&visits[first_visits + part / PATCH_PARTS]) >> k & 1u) != 0u {
            total += part_sums[part_sums_at(part, k) + sum];
        }
    }
    return total;
}

@compute @workgroup_size(RASTER_GROUP)
fn raster_bwd_subgroups(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(subgroup_id) subgroup: u32,
    @builtin(subgroup_size) subgroup_size: u32,
    @builtin(subgroup_invocation_id) subgroup_lane: u32,
) {
    // By subgroups: which invocations form one is up to the device. Below RASTER_GROUP if all are full, as this kernel needs.
    let lane = subgroup * subgroup_size + subgroup_lane;
    // Backwards, so that the segments of long tiles are begun first.
    let segment = segment_of(groups.x * groups.y - 1u - group_index(group, groups));
    let summed_range = summed_pairs(segment.range);
    if summed_range.x >= summed_range.y {
        return;
    }
    let origin_px = tile_origin_px(segment.tile);
    let pixel = origin_px + pixel_in_tile(lane);
    var replay = replay_at(pixel, segment.tile_first);
    if replay.end > segment.range.y {
        begin_at(&replay, segment.range.y, lane);
    }
    var visitor = Visitor(pixel, subgroup_lane, lane / SUM_LANES, 0.0);
#if STATISTICS
    if all(pixel < step.size_px) {
        visitor.loss = pixel_loss(pixel);
    }
#endif
    if lane < NUM_VISITS {
        atomicStore(&visits[lane], 0u);
    }
    // The batches end where the summed pairs do. At most the segment's last pair, as `begin_at` sets `end` no further.
    var past = used_pairs(summed_range, segment.range.x, replay.end, lane);
    var first_visits = 0u;
    while past > summed_range.x {
        let summed = past <= summed_range.y;
        let count = min(BATCH, past - select(summed_range.y, summed_range.x, summed));
        if lane < count {
            // `count` is at most BATCH, and the pairs that are left.
            let splat = pairs[past - 1u - lane];
            batch[lane] = splat;
            mark_visits(first_visits, lane, projected[splat].box_min, projected[splat].box_max, origin_px);
        }
        workgroupBarrier();
        if lane < NUM_PATCHES {
            // `first_visits` is 0 or NUM_PATCHES.
            atomicStore(&visits[NUM_PATCHES - first_visits + lane], 0u);
        }
        var left = subgroupBroadcastFirst(atomicLoad(&visits[first_visits + lane / PATCH_LANES]));
        while left != 0u {
            // Below `count`: only such bits are set.
            let k = firstTrailingBit(left);
            left &= left - 1u;
            visit(&replay, visitor, k, past - 1u - k, summed);
        }
        workgroupBarrier();
        for (var at = lane; summed && at < count * NUM_SUMS; at += RASTER_GROUP) {
            let k = at / NUM_SUMS;
            let sum = at % NUM_SUMS;
            var total = 0.0;
            if sum != SUM_FAULTS {
                total = tile_sum(first_visits, k, sum - u32(sum > SUM_FAULTS));
            }
            // Summed pairs: one of partial_capacity.
            partials[(past - 1u - k - step.partial_first) * NUM_SUMS + sum] = total;
        }
        past -= count;
        first_visits = NUM_PATCHES - first_visits;
    }
    store_faults(summed_range.x, replay.faults, lane);
}
