// Adds to the costs of a splat's parts the squares of one probe's derivatives, and zeroes the first moments that hold them
// (twin: `costs_of` in src/backend/costs.rs).
// Workgroup: a visible splat; the derivatives of others are 0. Invocation: a float of its SH, and every SPLAT_GROUP-th texel of
// its map.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/splat
#include common/coarser_map

@group(0) @binding(1) var<storage, read> splat_p: array<f32>; // [num_splat_floats]
@group(0) @binding(2) var<storage, read_write> splat_m: array<f32>; // [num_splat_floats]
@group(0) @binding(3) var<storage, read> texel_p: array<f32>; // [T, 3]
@group(0) @binding(4) var<storage, read_write> texel_m: array<f32>; // [T, 3]
@group(0) @binding(5) var<storage, read> splat_info: array<SplatInfo>; // [n]
// Per splat: probes that saw it; removal, colour; SH above degree 0, 1, 2; map; map coarser along both axes, u, v; crops by
// axis, end and depth.
@group(0) @binding(6) var<storage, read_write> costs: array<f32>; // [n, 22]
@group(0) @binding(7) var<storage, read> visible: array<u32>; // [1 + n] number of visible splats, then these, ascending

const COSTS = 22u;

// Changes of the probe's sum, by what is lost: map and three coarser maps; crops along u; crops along v.
var<workgroup> by_map: array<mat4x4f, SPLAT_GROUP>;
// Losses of SH bands, and squares of the derivatives by colour.
var<workgroup> by_sh: array<vec4f, SPLAT_GROUP>;

fn added(at: u32, value: f32) {
    costs[at] += value * value;
}

// The residual of a texel's channel, and the derivative by it.
fn texel_of(at: u32) -> vec2f {
    let value = texel_value(texel_p[at]);
    return vec2f(value, step.probe_scale * texel_m[at] / texel_value_slope(value));
}

// 1 where a line of the map is among the first or the last ones that a crop takes off: first of three depths, then last.
fn cropped(line: u32, texels: u32) -> array<vec3f, 2> {
    let depths = max(vec3u(1u, texels / 4u, texels / 2u), vec3u(1u));
    let first = select(vec3f(0.0), vec3f(1.0), vec3u(line) < depths);
    let last = select(vec3f(0.0), vec3f(1.0), vec3u(texels - 1u - line) < depths);
    return array(first, last);
}

fn sh_changes(f: u32, first: u32) -> vec4f {
    let derivative = step.probe_scale * splat_m[first + SH + f];
    let lost = splat_p[first + SH + f] * derivative;
    let by_colour = derivative / SH_0;
    return vec4f(
        select(0.0, lost, f >= 3u),
        select(0.0, lost, f >= 12u),
        select(0.0, lost, f >= 27u),
        select(0.0, by_colour * by_colour, f < 3u),
    );
}

// What a coarser map would show at a texel's channel.
fn sampled(map: CoarserMap, first: u32, cols: u32, at: vec2u, channel: u32) -> f32 {
    var sum = 0.0;
    let us = taps(map.u, at.x);
    let vs = taps(map.v, at.y);
    for (var k = 0u; k < 4u; k += 1u) {
        let weight = us.weights[k / 2u] * vs.weights[k % 2u];
        if weight > 0.0 {
            let rows = pair_of(map.u, us.texels[k / 2u]);
            let columns = pair_of(map.v, vs.texels[k % 2u]);
            let a = texel_value(texel_p[first + 3u * (rows.x * cols + columns.x) + channel]);
            let b = texel_value(texel_p[first + 3u * (rows.x * cols + columns.y) + channel]);
            let c = texel_value(texel_p[first + 3u * (rows.y * cols + columns.x) + channel]);
            let d = texel_value(texel_p[first + 3u * (rows.y * cols + columns.y) + channel]);
            sum += weight * (a + b + c + d) / 4.0;
        }
    }
    return sum;
}

fn map_changes(info: SplatInfo, texel: u32) -> mat4x4f {
    let rows = map_rows(info.map_size);
    let cols = map_cols(info.map_size);
    let first = 3u * info.map_offset_texels;
    let at = vec2u(texel / cols, texel % cols);
    var lost = 0.0;
    var coarser = vec3f(0.0);
    for (var channel = 0u; channel < 3u; channel += 1u) {
        let value = texel_of(first + 3u * texel + channel);
        lost += value.x * value.y;
        for (var k = 0u; k < 3u; k += 1u) {
            let map = coarser_map(info, k != 2u, k != 1u);
            if map.exists {
                coarser[k] += (sampled(map, first, cols, at, channel) - value.x) * value.y;
            }
        }
    }
    let u = cropped(at.x, rows);
    let v = cropped(at.y, cols);
    // 16 numbers: map, coarser maps, crops.
    return mat4x4f(
        vec4f(lost, coarser),
        lost * vec4f(u[0], u[1].x),
        lost * vec4f(u[1].yz, v[0].xy),
        lost * vec4f(v[0].z, v[1]),
    );
}

@compute @workgroup_size(SPLAT_GROUP)
fn probe_costs(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = group_index(group, groups);
    if place >= visible[0] {
        return;
    }
    let i = visible[1u + place];
    let info = splat_info[i];
    let first = first_float(info.parameters);
    let texels = num_texels(info.map_size);
    let by_logit = step.probe_scale * splat_m[first + OPACITY];
    var map = mat4x4f();
    for (var texel = lane; texel < texels; texel += SPLAT_GROUP) {
        map += map_changes(info, texel);
    }
    by_map[lane] = map;
    by_sh[lane] = vec4f(0.0);
    if SH + lane < num_floats(info.parameters) {
        by_sh[lane] = sh_changes(lane, first);
    }
    workgroupBarrier();
    for (var half = SPLAT_GROUP / 2u; half > 0u; half /= 2u) {
        if lane < half {
            by_map[lane] += by_map[lane + half];
            by_sh[lane] += by_sh[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u && by_logit != 0.0 {
        let out = COSTS * i;
        costs[out] += 1.0;
        // The logit over the transparency.
        added(out + 1u, by_logit * (1.0 + exp(splat_p[first + OPACITY])));
        costs[out + 2u] += by_sh[0].w;
        added(out + 3u, by_sh[0].x);
        added(out + 4u, by_sh[0].y);
        added(out + 5u, by_sh[0].z);
        for (var k = 0u; k < 16u; k += 1u) {
            added(out + 6u + k, by_map[0][k / 4u][k % 4u]);
        }
    }
    // The next probe begins with moments of 0. All have been read.
    storageBarrier();
    for (var f = lane; f < num_floats(info.parameters); f += SPLAT_GROUP) {
        splat_m[first + f] = 0.0;
    }
    for (var f = lane; f < 3u * texels; f += SPLAT_GROUP) {
        texel_m[3u * info.map_offset_texels + f] = 0.0;
    }
}
