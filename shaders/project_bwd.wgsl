// Sums the partial sums of each splat's pairs in a fixed order, applies the chain rule back to its stored
// parameters, and takes one step of Adam (twins: reference/project_bwd.rs, reference/adam.rs; method 2.4, "per
// splat, once", and 4.1). Invisible splats step with a zero gradient, except for their SH, which are updated
// lazily.
// GEOMETRY: also the sums by depth and normal.
// Workgroup: a splat. Invocation: a sum over the pairs, then a float of the parameters.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/splat
#include common/pair_sums
#include common/projected
#include common/bounds
#include common/filter
#include common/adam
#include common/sh

@group(0) @binding(1) var<storage, read_write> splat_p: array<f32>; // [num_splat_floats]
@group(0) @binding(2) var<storage, read_write> splat_m: array<f32>; // [num_splat_floats]
@group(0) @binding(3) var<storage, read_write> splat_v: array<f32>; // [num_splat_floats]
@group(0) @binding(4) var<storage, read> projected: array<Projected>; // [n]
@group(0) @binding(5) var<storage, read_write> bounds: array<Bounds>; // [n]
@group(0) @binding(6) var<storage, read> partials: array<f32>; // [K, partial_stride] by slot
@group(0) @binding(7) var<storage, read_write> statistics: array<vec4f>; // [n] seen, area, weight, error
@group(0) @binding(8) var<storage, read> splat_info: array<SplatInfo>; // [n]

#if GEOMETRY
const MAX_SUMS = PAIR_SUMS_GEOMETRY;
#else
const MAX_SUMS = PAIR_SUMS_STATISTICS;
#endif
// Each sum over the pairs of a splat is split among this many invocations.
const PARTS = 4u;
const MAX_FLOATS = 58u;

var<workgroup> parts: array<f32, MAX_SUMS * PARTS>;
var<workgroup> sums: array<f32, MAX_SUMS>;
var<workgroup> gradient: array<f32, MAX_FLOATS>;
var<workgroup> num_faults: atomic<u32>;

fn add_part(index: u32, bounds: Bounds) {
    let sum = index % step.partial_stride;
    let part = index / step.partial_stride;
    var total = 0.0;
    for (var slot = part; slot < bounds.num_tiles; slot += PARTS) {
        total += partials[(bounds.first_slot + slot) * step.partial_stride + sum];
    }
    parts[sum * PARTS + part] = total;
}

fn vec3_at(base: u32) -> vec3f {
    return vec3f(splat_p[base], splat_p[base + 1u], splat_p[base + 2u]);
}

fn set_gradient(at: u32, v: vec3f) {
    gradient[at] = v.x;
    gradient[at + 1u] = v.y;
    gradient[at + 2u] = v.z;
}

// Derivatives with respect to the centre and the surfel axes in camera axes, and from there by the stored parameters.
fn chain_rule(i: u32) {
    let s = projected[i];
    let base = first_float(splat_info[i].parameters);
    let position = vec3_at(base);
    let p = in_camera(position) + camera_translation();
    let q_at = base + QUATERNION;
    let q = vec4f(splat_p[q_at], splat_p[q_at + 1u], splat_p[q_at + 2u], splat_p[q_at + 3u]);
    let axes = rotation_of(q);
    let e_u = in_camera(axes[0]);
    let e_v = in_camera(axes[1]);
    let n = in_camera(axes[2]);
    let scales = exp(vec2f(splat_p[base + LOG_SCALE], splat_p[base + LOG_SCALE + 1u]));
    let w0 = dot(p, n) / p.z;
    let per_px = 1.0 / (step.focal_px * w0);

    let u = vec3f(sums[SUM_U], sums[SUM_U + 1u], sums[SUM_U + 2u]);
    let v = vec3f(sums[SUM_V], sums[SUM_V + 1u], sums[SUM_V + 2u]);
    let d = vec3f(sums[SUM_D], sums[SUM_D + 1u], sums[SUM_D + 2u]);
    // The map in standard deviations is the map in local units over sigma.
    let sigma_a = cross(e_v, p).xy * per_px / scales.x;
    let sigma_b = cross(p, e_u).xy * per_px / scales.y;
    let spread = splat_spread(sigma_a, sigma_b, map_determinant(per_px, scales, p.z));
    let by_thinning = sums[SUM_FALLOFF] * s.opacity;
    let by_spread = spread_bwd(spread, by_thinning);
    let through = step.filter_px2;
    let by_a = (u.yz - v.yz * spread.v_a / spread.v_b) / spread.u_a
        + through * (by_spread.x * sigma_a + by_spread.y * sigma_b);
    let by_b = v.yz / spread.v_b + through * (by_spread.y * sigma_a + by_spread.z * sigma_b);
    let by_cross_a = vec3f(by_a * per_px / scales.x, 0.0);
    let by_cross_b = vec3f(by_b * per_px / scales.y, 0.0);
    let by_w0 = -(dot(by_a, sigma_a) + dot(by_b, sigma_b) + dot(d.yz, s.g)) / w0;
#if GEOMETRY
    let by_facing = vec3f(sums[SUM_NORMAL], sums[SUM_NORMAL + 1u], sums[SUM_NORMAL + 2u]);
    let by_n = vec3f(d.yz * per_px, 0.0) + by_w0 * p / p.z + select(by_facing, -by_facing, w0 > 0.0);
#else
    let by_n = vec3f(d.yz * per_px, 0.0) + by_w0 * p / p.z;
#endif
    let by_px = -(s.a * u.x + s.b * v.x + s.g * d.x) * step.focal_px / p.z;
#if GEOMETRY
    let by_projection = vec3f(by_px, -(sums[SUM_DEPTH] + dot(by_px, p.xy)) / p.z);
#else
    let by_projection = vec3f(by_px, -dot(by_px, p.xy) / p.z);
#endif
    let by_plane = (n - vec3f(0.0, 0.0, w0)) / p.z;
    let by_centre = cross(by_cross_a, e_v) + cross(e_u, by_cross_b) + by_w0 * by_plane + by_projection;
    let by_axes = mat3x3f(in_local(cross(by_cross_b, p)), in_local(cross(p, by_cross_a)), in_local(by_n));

    set_gradient(POSITION, in_local(by_centre) + sh_bwd(i, position, s.rgb));
    let by_q = quaternion_bwd(q, by_axes);
    gradient[QUATERNION] = by_q.x;
    set_gradient(QUATERNION + 1u, by_q.yzw);
    gradient[LOG_SCALE] = by_spread.x + by_thinning;
    gradient[LOG_SCALE + 1u] = by_spread.z + by_thinning;
    let opacity = bounds[i].opacity;
    gradient[OPACITY] = (by_thinning + step.opacity_weight * opacity) * (1.0 - opacity);
}

// Derivative with respect to the spread's covariance, times 2: entries uu, uv, vv. The opacity is divided by the root of
// the covariance's determinant.
fn spread_bwd(spread: Spread, by_thinning: f32) -> vec3f {
    let aa = sums[SUM_EXPONENT] - by_thinning;
    let ab = sums[SUM_EXPONENT + 1u];
    let bb = sums[SUM_EXPONENT + 2u] - by_thinning;
    let vv = bb / (spread.v_b * spread.v_b);
    let uv = (ab / spread.v_b - spread.v_a * vv) / spread.u_a;
    let uu = (aa / spread.u_a - spread.v_a * (ab / (spread.u_a * spread.v_b) + uv)) / spread.u_a;
    return vec3f(uu, uv, vv);
}

fn degree_in_use(i: u32) -> u32 {
    return min(step.sh_degree, sh_degree(splat_info[i].parameters));
}

// Writes the gradient of the SH and returns the derivative with respect to the position through the view direction.
fn sh_bwd(i: u32, position: vec3f, rgb: vec3f) -> vec3f {
    let base = first_float(splat_info[i].parameters);
    let degree = degree_in_use(i);
    let by_clamped = vec3f(sums[SUM_RGB], sums[SUM_RGB + 1u], sums[SUM_RGB + 2u]);
    let by_rgb = select(vec3f(0.0), by_clamped, rgb > vec3f(0.0));
    let offset = position - step.camera_in_local;
    let distance = length(offset);
    let direction = offset / distance;
    let basis = sh_basis(degree, direction);
    let slopes = sh_basis_derivative(degree, direction);
    var by_direction = vec3f(0.0);
    for (var k = 0u; k < sh_coefficients(degree); k += 1u) {
        set_gradient(SH + 3u * k, basis[k] * by_rgb);
        by_direction += slopes[k] * dot(vec3_at(base + SH + 3u * k), by_rgb);
    }
    return (by_direction - direction * dot(direction, by_direction)) / distance;
}

// Derivative with respect to a stored quaternion (wxyz) from those by the columns of its rotation.
fn quaternion_bwd(stored: vec4f, by: mat3x3f) -> vec4f {
    let norm = length(stored);
    let q = stored / norm;
    let w = q.x;
    let x = q.y;
    let y = q.z;
    let z = q.w;
    let by_unit = 2.0 * vec4f(
        z * (by[0][1] - by[1][0]) + y * (by[2][0] - by[0][2]) + x * (by[1][2] - by[2][1]),
        y * (by[1][0] + by[0][1]) + z * (by[2][0] + by[0][2]) + w * (by[1][2] - by[2][1])
            - 2.0 * x * (by[1][1] + by[2][2]),
        x * (by[1][0] + by[0][1]) + w * (by[2][0] - by[0][2]) + z * (by[1][2] + by[2][1])
            - 2.0 * y * (by[0][0] + by[2][2]),
        w * (by[0][1] - by[1][0]) + x * (by[2][0] + by[0][2]) + y * (by[2][1] + by[1][2])
            - 2.0 * z * (by[0][0] + by[1][1]),
    );
    return (by_unit - q * dot(q, by_unit)) / norm;
}

fn rate_of(f: u32) -> f32 {
    if f < QUATERNION {
        return step.rate_position;
    } else if f < LOG_SCALE {
        return step.rate_quaternion;
    } else if f < OPACITY {
        return step.rate_log_scale;
    } else if f < SH {
        return step.rate_opacity;
    }
    return select(step.rate_sh_rest, step.rate_sh_dc, f < SH + 3u);
}

fn update(i: u32, f: u32) {
    var by = gradient[f];
    if !is_finite(by) {
        by = 0.0;
        atomicAdd(&num_faults, 1u);
    }
    let at = first_float(splat_info[i].parameters) + f;
    var now = adam_step(Moments(splat_p[at], splat_m[at], splat_v[at]), by, rate_of(f));
    if f >= LOG_SCALE && f < OPACITY {
        now.p = clamp(now.p, LOG_SCALE_MIN, LOG_SCALE_MAX);
    }
    splat_p[at] = now.p;
    splat_m[at] = now.m;
    splat_v[at] = now.v;
}

@compute @workgroup_size(SPLAT_GROUP)
fn project_bwd(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups);
    if i >= step.num_splats {
        return;
    }
    // Not written before the last barrier.
    let footprint = bounds[i];
    let visible = footprint.num_tiles > 0u;
    if lane < MAX_FLOATS {
        gradient[lane] = 0.0;
    }
    if lane == 0u {
        atomicStore(&num_faults, 0u);
    }
    for (var index = lane; visible && index < step.partial_stride * PARTS; index += SPLAT_GROUP) {
        add_part(index, footprint);
    }
    workgroupBarrier();
    if lane < MAX_SUMS {
        let at = lane * PARTS;
        let known = visible && lane < step.partial_stride;
        sums[lane] = select(0.0, (parts[at] + parts[at + 1u]) + (parts[at + 2u] + parts[at + 3u]), known);
    }
    workgroupBarrier();
    if lane == 0u && visible {
        chain_rule(i);
    }
    workgroupBarrier();
    // SH of degrees not in use, and all SH of invisible splats, take no step.
    let used = select(SH, SH + 3u * sh_coefficients(degree_in_use(i)), visible);
    if lane < used {
        update(i, lane);
    }
    workgroupBarrier();
    if lane == 0u && visible {
        bounds[i].faults = atomicLoad(&num_faults) + u32(sums[SUM_FAULTS]);
        if has_flag(FLAG_STATISTICS) {
            let num_pixels = f32(step.size_px.x * step.size_px.y);
            let at = SUM_STATISTICS;
            statistics[i] += vec4f(1.0, vec3f(sums[at], sums[at + 1u], sums[at + 2u]) / num_pixels);
        }
    }
}
