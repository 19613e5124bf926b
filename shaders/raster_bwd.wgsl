// Backward rasterisation: walks the splats of a tile back to front, and sums the derivatives w.r.t. the projected
// quantities of each splat and by its texels over the tile's pixels (twin: reference/raster_bwd.rs; method 2.4).
// Workgroup: a tile. Invocation: a pixel, then a (quantity, row of pixels) of the sums, then a sum or a texel
// channel.
//
// Per splat, each invocation stores the derivatives of its pixel in workgroup memory; then the invocations sum
// them up in a fixed order, with two barriers, no atomics and no subgroups. A pair's sums go to its place in `partials`, which
// holds those of `partial_capacity` pairs from `partial_first` on. Texel gradients are summed the same way, one block of
// 4 x 4 texels at a time, and added to memory in fixed point: three atomics per texel and tile.
//
// Software drivers execute both sides of every branch, and pay at each barrier for every value that lives across it.
// Hence two barriers per splat, little code, and select() instead of branches: an earlier form with more of both took
// 3.9 times as long on lavapipe.
//
// STATISTICS: also the sums for the window statistics.
// GEOMETRY (with STATISTICS): also the distortion and normal terms.
// SCATTER (hardware): windows of many texels are not gathered; each tap is an atomic. The fixed-point unit is
// that of the splat's whole box, so that the rounding of single taps shows where a splat covers much of the
// image.
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
#include common/tile_pairs
#include common/tile_sums

@group(0) @binding(1) var<storage, read> projected: array<Projected>; // [n]
@group(0) @binding(2) var<storage, read> pairs: array<u32>; // [3, pair_capacity] by tile, front to back
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

// Quantities that a pixel stores, [quantity, column, row]. The first three are also summed times dx and dy.
const U = 0u; // by the first coordinate on the surfel, over the denominator
const V = 1u;
const D = 2u; // by the denominator
const FALLOFF = 3u; // by the opacity
const PLANE_X = 4u; // coordinates on the surfel
const PLANE_Y = 5u;
const RED = 6u;
const NUM_GEOMETRY = 9u;
const TEXEL_U = 9u; // texture coordinates
const TEXEL_V = 10u;
#if STATISTICS
const WEIGHT = 11u;
const NUM_QUANTITIES = 12u;
#if GEOMETRY
const TEXEL_PARTS = 4u;
#else
const TEXEL_PARTS = 8u;
#endif
#else
const NUM_QUANTITIES = 11u;
const TEXEL_PARTS = TILE_ROWS_PX;
#endif
const BLOCK_TEXELS = 4u;
// Each sum has one part per row of pixels.
const PARTS = TILE_ROWS_PX;

// Texel channels of a block.
const NUM_CHANNELS = 3u * BLOCK_TEXELS * BLOCK_TEXELS;
#if SCATTER
// Windows of more blocks than this are scattered.
const GATHERED_BLOCKS_MAX = 9u;
#endif

var<workgroup> lanes: array<f32, NUM_QUANTITIES * RASTER_GROUP>;
var<workgroup> texel_parts: array<f32, NUM_CHANNELS * TEXEL_PARTS>;
var<workgroup> sum_parts: array<f32, NUM_SUMS * PARTS>;

// `quantity` is one of the above, and `at` a pixel of the tile, below RASTER_GROUP.
fn store(quantity: u32, at: u32, value: f32) {
    lanes[quantity * RASTER_GROUP + at] = value;
}

// Derivatives of one pixel with respect to one splat; zeros where the splat was not blended.
fn pixel_bwd(replay: ptr<function, Replay>, s: Projected, index: u32, pixel: vec2u, at: u32, scattered: bool) {
    let hit = splat_hit(s, vec2f(pixel) + 0.5);
    var by = SampleGradient();
    by.coordinate = NOWHERE;
    if is_blended(replay, s, index, hit, pixel) {
        let taps = texture_taps(s, hit.plane);
        by = sample_bwd(replay, s, index, hit, taps);
#if SCATTER
        if scattered && taps.inside {
            (*replay).faults += scatter(s, taps, by.by_colour);
        }
#endif
    }
    store(U, at, by.by_hit.x);
    store(V, at, by.by_hit.y);
    store(D, at, by.by_hit.z);
    store(FALLOFF, at, by.by_falloff);
    store(PLANE_X, at, by.plane.x);
    store(PLANE_Y, at, by.plane.y);
    store(RED, at, by.by_colour.x);
    store(RED + 1u, at, by.by_colour.y);
    store(RED + 2u, at, by.by_colour.z);
    store(TEXEL_U, at, by.coordinate.x);
    store(TEXEL_V, at, by.coordinate.y);
#if STATISTICS
    store(WEIGHT, at, by.weight);
#endif
}

// Adds a channel of the block, that of a texel of the map, to memory; `num_pixels` may have contributed. Returns the faults.
fn add_channel(s: Projected, texel: vec2u, channel: u32, num_pixels: u32) -> u32 {
    var total = 0.0;
    for (var k = 0u; k < TEXEL_PARTS; k += 1u) {
        total += texel_parts[channel * TEXEL_PARTS + k];
    }
    let texel_at = s.map_offset_texels + texel.x * map_cols(s.map_size) + texel.y;
    let units = texel_units(s.box_min, s.box_max);
    return add_fixed(3u * texel_at + channel % 3u, total, units, fixed_limit(units, num_pixels));
}

@compute @workgroup_size(RASTER_GROUP)
fn raster_bwd(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = group_index(group, groups);
    if tile >= step.grid.x * step.grid.y {
        return;
    }
    let range = tile_ranges[tile];
    let summed_range = summed_pairs(range);
    let first_pair = summed_range.x;
    let past_pair = summed_range.y;
    if first_pair >= past_pair {
        return;
    }
    let origin_px = tile_origin_px(tile);
    let pixel_at = pixel_in_tile(lane);
    let pixel = origin_px + pixel_at;
    var replay = replay_at(pixel, range.x);
    let used = used_pairs(summed_range, range.x, replay.end, lane);
    let at = pixel_at.x * PARTS + pixel_at.y;
    let row = lane % PARTS;
    let quantity = lane / PARTS;
    // Counted from the last invocation: the first ones are busy with other sums.
    let from_last = RASTER_GROUP - 1u - lane;
    var i = used;
    var block = 0u;
    // One iteration per block of texels of each splat; the first of a splat also does everything else.
    while i > first_pair {
        let summed = i <= past_pair;
        // `used` is at most range.y, and that at most pair_capacity.
        let window = vec2u(pairs[window_first_at(i - 1u)], pairs[window_past_at(i - 1u)]);
        let s = projected[pairs[i - 1u]];
        let low = max(vec2u(s.box_min & 0xffffu, s.box_min >> 16u), origin_px) - origin_px;
        let high = min(vec2u(s.box_max & 0xffffu, s.box_max >> 16u) - origin_px, TILE_SIZE_PX);
        let window_first = vec2u(window.x & 0xffffu, window.x >> 16u);
        let window_past = vec2u(window.y & 0xffffu, window.y >> 16u);
        let blocks = (window_past - window_first + BLOCK_TEXELS - 1u) / BLOCK_TEXELS;
        var num_blocks = select(0u, blocks.x * blocks.y, summed);
#if SCATTER
        let scattered = num_blocks > GATHERED_BLOCKS_MAX;
        num_blocks = select(num_blocks, 0u, scattered);
#else
        let scattered = false;
#endif
        let first = window_first + BLOCK_TEXELS * vec2u(block / max(blocks.y, 1u), block % max(blocks.y, 1u));
        if block == 0u {
            pixel_bwd(&replay, s, i - 1u, pixel, at, scattered);
        }
        workgroupBarrier();
        let columns = select(vec2u(0u), vec2u(low.x, high.x), row >= low.y && row < high.y);
        if block == 0u && quantity == FALLOFF {
            exponent_row(s, row, columns);
        }
        if block == 0u && (quantity < FALLOFF || (quantity >= RED && quantity < NUM_GEOMETRY)) {
            sum_row(quantity, row, columns, vec2f(origin_px) + 0.5 - s.centre_px);
        }
#if STATISTICS
        if block == 0u && quantity == NUM_GEOMETRY {
            statistics_row(row, columns, origin_px);
        }
#endif
#if GEOMETRY
        if block == 0u && quantity == NUM_GEOMETRY + 1u {
            geometry_row(s, row, columns, origin_px);
        }
#endif
        if num_blocks > 0u && from_last < BLOCK_TEXELS * TEXEL_PARTS {
            gather_row(s, first, from_last / TEXEL_PARTS, from_last % TEXEL_PARTS, low, high);
        }
        workgroupBarrier();
        if lane < NUM_CHANNELS {
            let texel = first + vec2u(lane / 3u / BLOCK_TEXELS, lane / 3u % BLOCK_TEXELS);
            // The block may reach beyond the window, which lies within the map.
            if num_blocks > 0u && all(texel < window_past) {
                replay.faults += add_channel(s, texel, lane, (high.x - low.x) * (high.y - low.y));
            }
        }
        if block == 0u && summed && from_last < NUM_SUMS {
            var total = 0.0;
            for (var k = 0u; k < PARTS && from_last != SUM_FAULTS; k += 1u) {
                total += sum_parts[from_last * PARTS + k];
            }
            // From first_pair on and, as it is summed, before past_pair: one of partial_capacity.
            partials[(i - 1u - step.partial_first) * NUM_SUMS + from_last] = total;
        }
        block += 1u;
        if block >= num_blocks {
            block = 0u;
            i -= 1u;
        }
    }
    store_faults(first_pair, replay.faults, lane);
}
