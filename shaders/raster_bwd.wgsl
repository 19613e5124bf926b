// Backward rasterisation: a workgroup per tile, splats back to front (twin: reference/raster_bwd.rs; method
// 2.4). For each splat every invocation leaves the derivatives of its pixel in workgroup memory; then the same
// invocations, as (sum, part of the pixels), add them up in a fixed order: two barriers a splat, no atomics, no
// subgroups. Sums go to the pair's unsorted slot. Texel gradients are gathered the same way and reach memory as
// fixed point, a few atomics per texel and tile. STATISTICS: four more sums.

#constants
#include common/numbers
#include common/step
#include common/splat
#include common/projected
#include common/tile
#include common/hit
#include common/fixed
#include common/texel_window

@group(0) @binding(1) var<storage, read> projected: array<Projected>; // [n]
@group(0) @binding(2) var<storage, read> pairs: array<vec2u>; // [K] slot, splat; by tile, front to back
@group(0) @binding(3) var<storage, read> tile_ranges: array<vec2u>; // [tiles] of pairs
@group(0) @binding(4) var<storage, read> texel_values: array<vec4f>; // [T] residual rgb
@group(0) @binding(5) var<storage, read> pixel_state: array<vec2u>; // [P] transmittance, end of pairs
@group(0) @binding(6) var<storage, read> pixel_grad: array<vec4f>; // [P] by rgb; loss of the pixel
@group(0) @binding(7) var<storage, read_write> partials: array<f32>; // [K, partial_stride] by slot
@group(0) @binding(8) var<storage, read_write> texel_grad: array<atomic<i32>>; // [T, 3] fixed point

// What a pixel leaves behind, [quantity, pixel].
const U = 0u; // by the coordinate along u over the denominator
const V = 1u;
const D = 2u; // by the denominator
const SCALE_U = 3u; // by the log-scales
const SCALE_V = 4u;
const FALLOFF = 5u; // by the opacity
const RED = 6u;
const TEXEL_U = 9u; // texture coordinates
const TEXEL_V = 10u;
#if STATISTICS
const WEIGHT = 11u;
const TRANSMITTANCE = 12u;
const NUM_QUANTITIES = 13u;
const NUM_SUMS = 20u;
const TEXEL_PARTS = 8u;
#else
const NUM_QUANTITIES = 11u;
const NUM_SUMS = 16u;
const TEXEL_PARTS = 16u;
#endif
const PARTS = 16u;
const TEXELS_PER_ROUND = 16u;

var<workgroup> lanes: array<f32, NUM_QUANTITIES * GROUP>;
var<workgroup> sums: array<f32, NUM_SUMS * PARTS>;
var<workgroup> texel_sums: array<f32, 3u * TEXELS_PER_ROUND * TEXEL_PARTS>;
var<workgroup> last: atomic<u32>;
var<workgroup> end: u32;
var<workgroup> num_faults: atomic<u32>;

// The pixel on its way back to front.
struct Replay {
    transmittance: f32,
    // Derivative by weight of everything behind, times its weight.
    behind: f32,
    end: u32,
    by_rgb: vec3f,
}

fn leave(quantity: u32, lane: u32, value: f32) {
    lanes[quantity * GROUP + lane] = value;
}

fn leave_nothing(lane: u32) {
    for (var q = 0u; q < NUM_QUANTITIES; q += 1u) {
        leave(q, lane, 0.0);
    }
    leave(TEXEL_U, lane, -1e9);
}

// One pixel of one splat. Where the window is too large to be gathered, texels get their share at once.
fn pixel_bwd(replay: ptr<function, Replay>, s: Projected, index: u32, pixel: vec2u, lane: u32, gathered: bool) {
    if index >= (*replay).end || !in_box(s, pixel) {
        leave_nothing(lane);
        return;
    }
    let hit = splat_hit(s, vec2f(pixel) + 0.5);
    if !hit.inside {
        leave_nothing(lane);
        return;
    }
    let alpha = min(hit.raw_alpha, ALPHA_MAX);
    let per_rest = 1.0 / (1.0 - alpha);
    let before = (*replay).transmittance * per_rest;
    let weight = alpha * before;
    var colour = max(s.rgb, vec3f(0.0));
    let taps = texture_taps(s, hit.plane);
    var values = array<vec3f, 4>();
    if taps.inside {
        values = tap_values(s, taps);
        colour += residual(values, taps.fraction);
    }
    let by_rgb = (*replay).by_rgb;
    let by_weight = dot(by_rgb, max(colour, vec3f(0.0)));
    let by_alpha = before * by_weight - (*replay).behind * per_rest;
    (*replay).behind += weight * by_weight;
    (*replay).transmittance = before;

    // Passes where the colour is positive or descent would raise it.
    let passes = (colour > vec3f(0.0)) | (by_rgb < vec3f(0.0));
    let by_colour = select(vec3f(0.0), by_rgb * weight, passes);
    let by_falloff = select(0.0, by_alpha * hit.falloff, hit.raw_alpha <= ALPHA_MAX);
    let by_plane = by_falloff * s.opacity * hit.plane;
    var by_coordinate = vec2f(0.0);
    leave(TEXEL_U, lane, -1e9);
    leave(TEXEL_V, lane, 0.0);
    if taps.inside {
        let f = taps.fraction;
        by_coordinate = vec2f(
            dot(by_colour, (1.0 - f.y) * (values[2] - values[0]) + f.y * (values[3] - values[1])),
            dot(by_colour, (1.0 - f.x) * (values[1] - values[0]) + f.x * (values[3] - values[2])),
        );
        leave(TEXEL_U, lane, taps.coordinate.x);
        leave(TEXEL_V, lane, taps.coordinate.y);
        if !gathered {
            scatter(s, taps, by_colour);
        }
    }
    let by_hit = (by_coordinate * s.texels_per_sigma - by_plane) * hit.per_denominator;
    leave(U, lane, by_hit.x);
    leave(V, lane, by_hit.y);
    leave(D, lane, -dot(by_hit, hit.plane));
    leave(SCALE_U, lane, by_plane.x * hit.plane.x);
    leave(SCALE_V, lane, by_plane.y * hit.plane.y);
    leave(FALLOFF, lane, by_falloff);
    leave(RED, lane, by_colour.x);
    leave(RED + 1u, lane, by_colour.y);
    leave(RED + 2u, lane, by_colour.z);
#if STATISTICS
    leave(WEIGHT, lane, weight);
    leave(TRANSMITTANCE, lane, before);
#endif
}

fn scatter(s: Projected, taps: Taps, by_colour: vec3f) {
    let f = taps.fraction;
    add_texel(s, taps.first, by_colour * ((1.0 - f.x) * (1.0 - f.y)));
    add_texel(s, taps.first + vec2i(0, 1), by_colour * ((1.0 - f.x) * f.y));
    add_texel(s, taps.first + vec2i(1, 0), by_colour * (f.x * (1.0 - f.y)));
    add_texel(s, taps.first + vec2i(1, 1), by_colour * (f.x * f.y));
}

fn add_texel(s: Projected, texel: vec2i, by_texel: vec3f) {
    let cols = i32(map_cols(s.map_size));
    if texel.x < 0 || texel.y < 0 || texel.x >= i32(map_rows(s.map_size)) || texel.y >= cols {
        return;
    }
    let at = 3u * (s.map_offset_texels + u32(texel.x * cols + texel.y));
    add_fixed(at, by_texel.x, s);
    add_fixed(at + 1u, by_texel.y, s);
    add_fixed(at + 2u, by_texel.z, s);
}

// Adds to a texel's gradient; what is not finite or too large is counted.
fn add_fixed(at: u32, by_texel: f32, s: Projected) {
    let limit = tile_limit(s.box_min, s.box_max);
    let units = by_texel * texel_units(s.box_min, s.box_max);
    if !(is_finite(units) && abs(units) <= limit) {
        atomicAdd(&num_faults, 1u);
    }
    let fixed = i32(round(select(0.0, clamp(units, -limit, limit), is_finite(units))));
    if fixed != 0 {
        atomicAdd(&texel_grad[at], fixed);
    }
}

// Part `part` of sum `sum` of a pair: quantity times 1, dx or dy.
fn partial_sum(sum: u32, part: u32, s: Projected, origin_px: vec2u) -> f32 {
    var total = 0.0;
#if STATISTICS
    if sum >= 16u {
        return statistic(sum, part, origin_px);
    }
#endif
    if sum >= 15u {
        return total;
    }
    let quantity = select(sum - 6u, sum / 3u, sum < 9u);
    let factor = select(0u, sum % 3u, sum < 9u);
    let by_1_dx_dy = vec3f(f32(factor == 0u), f32(factor == 1u), f32(factor == 2u));
    let to_first = vec2f(origin_px) + 0.5 - s.centre_px;
    for (var k = 0u; k < GROUP / PARTS; k += 1u) {
        let lane = k * PARTS + part;
        let offset_px = to_first + vec2f(pixel_in_tile(lane));
        total += lanes[quantity * GROUP + lane] * dot(by_1_dx_dy, vec3f(1.0, offset_px));
    }
    return total;
}

#if STATISTICS
// Pixels, blending weight, weight times loss, transmittance in front.
fn statistic(sum: u32, part: u32, origin_px: vec2u) -> f32 {
    var total = 0.0;
    for (var k = 0u; k < GROUP / PARTS; k += 1u) {
        let lane = k * PARTS + part;
        let weight = lanes[WEIGHT * GROUP + lane];
        if sum == 16u {
            total += f32(weight > 0.0);
        } else if sum == 17u {
            total += weight;
        } else if sum == 19u {
            total += lanes[TRANSMITTANCE * GROUP + lane];
        } else if weight > 0.0 {
            let pixel = origin_px + pixel_in_tile(lane);
            total += weight * pixel_grad[pixel.y * step.size_px.x + pixel.x].w;
        }
    }
    return total;
}
#endif

// Gradient of one texel over a part of the pixels, into workgroup memory.
fn gather_texel(window: Window, texel: u32, part: u32, at: u32) {
    var total = vec3f(0.0);
    if texel < window.rows * window.cols {
        let row = f32(window.row0 + texel / window.cols);
        let col = f32(window.col0 + texel % window.cols);
        for (var k = 0u; k < GROUP / TEXEL_PARTS; k += 1u) {
            let lane = k * TEXEL_PARTS + part;
            let w = max(1.0 - abs(lanes[TEXEL_U * GROUP + lane] - row), 0.0)
                * max(1.0 - abs(lanes[TEXEL_V * GROUP + lane] - col), 0.0);
            total += w * vec3f(
                lanes[RED * GROUP + lane],
                lanes[(RED + 1u) * GROUP + lane],
                lanes[(RED + 2u) * GROUP + lane],
            );
        }
    }
    for (var c = 0u; c < 3u; c += 1u) {
        texel_sums[(3u * at + c) * TEXEL_PARTS + part] = total[c];
    }
}

// Adds the parts of one channel of one gathered texel, and that to memory.
fn flush_texel(window: Window, s: Projected, round: u32, lane: u32) {
    let texel = round * TEXELS_PER_ROUND + lane / 3u;
    if lane >= 3u * TEXELS_PER_ROUND || texel >= window.rows * window.cols {
        return;
    }
    var total = 0.0;
    for (var part = 0u; part < TEXEL_PARTS; part += 1u) {
        total += texel_sums[lane * TEXEL_PARTS + part];
    }
    let row = window.row0 + texel / window.cols;
    let col = window.col0 + texel % window.cols;
    let at = s.map_offset_texels + row * map_cols(s.map_size) + col;
    add_fixed(3u * at + lane % 3u, total, s);
}

@compute @workgroup_size(GROUP)
fn raster_bwd(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = tile_of(group, groups);
    if tile >= step.grid.x * step.grid.y {
        return;
    }
    let range = tile_ranges[tile];
    let origin_px = tile_origin_px(tile);
    let pixel = origin_px + pixel_in_tile(lane);
    var replay = Replay(1.0, 0.0, range.x, vec3f(0.0));
    if all(pixel < step.size_px) {
        let at = pixel.y * step.size_px.x + pixel.x;
        let state = pixel_state[at];
        let t = bitcast<f32>(state.x);
        let by_rgb = pixel_grad[at].xyz;
        replay = Replay(t, dot(by_rgb, step.background) * t, state.y, by_rgb);
    }
    if lane == 0u {
        atomicStore(&last, range.x);
        atomicStore(&num_faults, 0u);
    }
    workgroupBarrier();
    atomicMax(&last, replay.end);
    workgroupBarrier();
    if lane == 0u {
        end = atomicLoad(&last);
    }
    let used = workgroupUniformLoad(&end);
    // Pairs behind everything have sums too: zeros.
    for (var k = used * NUM_SUMS + lane; k < range.y * NUM_SUMS; k += GROUP) {
        partials[pairs[k / NUM_SUMS].x * NUM_SUMS + k % NUM_SUMS] = 0.0;
    }
    for (var i = used; i > range.x; i -= 1u) {
        let pair = pairs[i - 1u];
        let s = projected[pair.y];
        let window = texel_window(s, origin_px);
        let num_window = window.rows * window.cols;
        let gathered = num_window <= GATHERED_TEXELS_MAX;
        pixel_bwd(&replay, s, i - 1u, pixel, lane, gathered);
        workgroupBarrier();
        for (var sum = lane / PARTS; sum < NUM_SUMS; sum += GROUP / PARTS) {
            sums[sum * PARTS + lane % PARTS] = partial_sum(sum, lane % PARTS, s, origin_px);
        }
        let rounds = select(0u, (num_window + TEXELS_PER_ROUND - 1u) / TEXELS_PER_ROUND, gathered);
        let part = lane % TEXEL_PARTS;
        let in_round = lane / TEXEL_PARTS;
        if rounds > 0u && in_round < TEXELS_PER_ROUND {
            gather_texel(window, in_round, part, in_round);
        }
        workgroupBarrier();
        // The last invocations write the sums, the first ones the texels.
        let sum = GROUP - 1u - lane;
        if sum < NUM_SUMS {
            var total = 0.0;
            for (var k = 0u; k < PARTS; k += 1u) {
                total += sums[sum * PARTS + k];
            }
            partials[pair.x * NUM_SUMS + sum] = total;
        }
        if rounds > 0u {
            flush_texel(window, s, 0u, lane);
        }
        for (var round = 1u; round < rounds; round += 1u) {
            workgroupBarrier();
            if in_round < TEXELS_PER_ROUND {
                gather_texel(window, round * TEXELS_PER_ROUND + in_round, part, in_round);
            }
            workgroupBarrier();
            flush_texel(window, s, round, lane);
        }
    }
    storageBarrier();
    workgroupBarrier();
    // Only the sum over all is told: the tile's first pair carries it.
    if lane == 0u && range.x < range.y {
        partials[pairs[range.x].x * NUM_SUMS + 15u] = f32(atomicLoad(&num_faults));
    }
}
