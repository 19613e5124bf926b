// Forward rasterisation: blends the splats of a tile front to back (twin: reference/raster_fwd.rs; method 1.3,
// 1.4, 2.1). In training steps it also stores the texel window of each pair for the backward pass, since it
// reads the splats anyway; or for that by subgroups the states of pixels between segments of a tile's pairs.
// Workgroup: a tile. Invocation: a pixel.
//
// BATCHED (hardware): splats are loaded through workgroup memory, and each patch of pixels passes over those whose boxes
// miss it; software drivers are 30-45 % faster without workgroup memory (measured).
// SEGMENTS: for the backward pass by subgroups; not with GEOMETRY, whose tiles are whole.
// COUNT: counts evaluated, inside and blended pixel-splat pairs.
// GEOMETRY: also sums depths and normals. Excludes COUNT: no binding is left.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/splat
#include common/projected
#include common/tile
#include common/hit
#if SEGMENTS
#include common/keep_states
#else
#include common/keep_windows
#endif
#include common/status

@group(0) @binding(1) var<storage, read> projected: array<Projected>; // [n]
@group(0) @binding(2) var<storage, read_write> pairs: array<u32>; // [pair_capacity] by tile, front to back; windows, or states of pixels
@group(0) @binding(3) var<storage, read> tile_ranges: array<vec2u>; // [tiles] of pairs
@group(0) @binding(4) var<storage, read> texel_values: array<vec4f>; // [T] residual rgb
@group(0) @binding(5) var<storage, read_write> pixels: array<vec4f>; // [P] rgb over background, transmittance
@group(0) @binding(6) var<storage, read_write> pixel_state: array<vec2u>; // [P] transmittance, one past the last blended pair
#if COUNT
@group(0) @binding(7) var<storage, read_write> status: array<Status>;

var<workgroup> counts: array<atomic<u32>, 3>;
#endif
#if GEOMETRY
@group(0) @binding(7) var<storage, read> normals: array<vec4f>; // [n] camera axes, facing the camera
// [P, 2] sums of weight times normal, weight times depth; weight times m, weight times m^2, 0, 0; with m the
// near depth over the depth of a sample
@group(0) @binding(8) var<storage, read_write> geometry: array<vec4f>;
#endif

// State of a pixel while it is blended.
struct Pixel {
    rgb: vec3f,
    transmittance: f32,
    // One past the last pair that was blended.
    end: u32,
    done: bool,
    evaluated: u32,
    inside: u32,
    blended: u32,
#if GEOMETRY
    normal_depth: vec4f,
    moments: vec2f,
#endif
#if SEGMENTS
    // The last boundary passed, and the colour since then.
    boundary: u32,
    segment_rgb: vec3f,
#endif
}

fn blend(state: ptr<function, Pixel>, s: Projected, index: u32, pixel: vec2u) {
    if !in_box(s, pixel) {
        return;
    }
    (*state).evaluated += 1u;
    let hit = splat_hit(s, vec2f(pixel) + 0.5);
    if !hit.inside {
        return;
    }
    (*state).inside += 1u;
    let alpha = min(hit.raw_alpha, ALPHA_MAX);
    let before = (*state).transmittance;
    let after = before * (1.0 - alpha);
    if after < TRANSMITTANCE_MIN {
        (*state).done = true;
        return;
    }
    var colour = max(s.rgb, vec3f(0.0));
    let taps = texture_taps(s, hit.plane);
    if taps.inside {
        colour = max(colour + residual(s, taps).value, vec3f(0.0));
    }
    let seen = colour * (alpha * before);
    (*state).rgb += seen;
#if SEGMENTS
    (*state).segment_rgb += seen;
#endif
#if GEOMETRY
    let weight = alpha * before;
    let m = s.near_over_depth * hit.denominator;
    (*state).normal_depth += weight * vec4f(normals[pairs[index]].xyz, step.near / m);
    (*state).moments += weight * vec2f(m, m * m);
#endif
    (*state).transmittance = after;
    (*state).end = index + 1u;
    (*state).blended += 1u;
}

#if BATCHED
const NUM_VISITS = RASTER_BATCH / 32u * NUM_PATCHES;
const_assert RASTER_BATCH == 64u; // `left` and `others`
#include common/visits

var<workgroup> batch: array<Projected, RASTER_BATCH>;
var<workgroup> num_done: atomic<u32>;
var<workgroup> all_done: u32;

fn raster_tile(state: ptr<function, Pixel>, range: vec2u, origin_px: vec2u, pixel: vec2u, lane: u32) {
    if lane == 0u {
        atomicStore(&num_done, 0u);
        all_done = 0u;
    }
    if lane < NUM_VISITS {
        atomicStore(&visits[lane], 0u);
    }
    workgroupBarrier();
    var was_done = false;
    if (*state).done {
        atomicAdd(&num_done, 1u);
        was_done = true;
    }
    for (var first = range.x; first < range.y; first += RASTER_BATCH) {
#if SEGMENTS
        // Segments are whole batches.
        keep_state(state, first, range.x, lane);
#endif
        let count = min(RASTER_BATCH, range.y - first);
        if lane < count {
            // range.y is at most the number of pairs.
            let s = projected[pairs[first + lane]];
            batch[lane] = s;
            store_window(s, first + lane, origin_px);
            mark_visits(lane / 32u * NUM_PATCHES, lane % 32u, s.box_min, s.box_max, origin_px);
        }
        workgroupBarrier();
        var left = atomicLoad(&visits[lane / PATCH_LANES]);
        // Not two loops, since `blend` is long.
        var others = atomicLoad(&visits[NUM_PATCHES + lane / PATCH_LANES]);
        var first_left = 0u;
        while (left | others) != 0u && !(*state).done {
            if left == 0u {
                left = others;
                others = 0u;
                first_left = 32u;
            }
            // Below `count`: only such bits are set.
            let k = first_left + firstTrailingBit(left);
            left &= left - 1u;
            blend(state, batch[k], first + k, pixel);
        }
        if (*state).done && !was_done {
            atomicAdd(&num_done, 1u);
            was_done = true;
        }
        workgroupBarrier();
        if lane == 0u {
            all_done = u32(atomicLoad(&num_done) == RASTER_GROUP);
        }
        if lane < NUM_VISITS {
            atomicStore(&visits[lane], 0u);
        }
        if workgroupUniformLoad(&all_done) != 0u {
            break;
        }
    }
}
#else
fn raster_tile(state: ptr<function, Pixel>, range: vec2u, origin_px: vec2u, pixel: vec2u, lane: u32) {
    // range.y is at most the number of pairs.
    for (var i = range.x + lane; i < range.y; i += RASTER_GROUP) {
        store_window(projected[pairs[i]], i, origin_px);
    }
    for (var i = range.x; i < range.y && !(*state).done; i += 1u) {
#if SEGMENTS
        keep_state(state, i, range.x, lane);
#endif
        blend(state, projected[pairs[i]], i, pixel);
    }
}
#endif

@compute @workgroup_size(RASTER_GROUP)
fn raster_fwd(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = group_index(group, groups);
    if tile >= step.grid.x * step.grid.y {
        return;
    }
    let origin_px = tile_origin_px(tile);
    let pixel = origin_px + pixel_in_tile(lane);
    let in_image = all(pixel < step.size_px);
    let range = tile_ranges[tile];
    var state = Pixel();
    state.transmittance = 1.0;
    state.end = range.x;
    state.done = !in_image;
    raster_tile(&state, range, origin_px, pixel, lane);
    if in_image {
        let at = pixel.y * step.size_px.x + pixel.x;
        let t = state.transmittance;
        pixels[at] = vec4f(state.rgb + t * step.background, t);
        pixel_state[at] = vec2u(bitcast<u32>(t), state.end);
#if GEOMETRY
        geometry[2u * at] = state.normal_depth;
        geometry[2u * at + 1u] = vec4f(state.moments, 0.0, 0.0);
#endif
#if SEGMENTS
        turn_states(state, range.x, lane);
#endif
    }
#if COUNT
    if lane < 3u {
        atomicStore(&counts[lane], 0u);
    }
    workgroupBarrier();
    atomicAdd(&counts[0], state.evaluated);
    atomicAdd(&counts[1], state.inside);
    atomicAdd(&counts[2], state.blended);
    workgroupBarrier();
    if lane == 0u {
        atomicAdd(&status[step.status_slot].evaluated, atomicLoad(&counts[0]));
        atomicAdd(&status[step.status_slot].inside, atomicLoad(&counts[1]));
        atomicAdd(&status[step.status_slot].blended, atomicLoad(&counts[2]));
    }
#endif
}
