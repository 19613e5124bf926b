// Applies the chain rule back from the sums over a splat's pairs to its stored parameters, and takes one step of Adam
// (twins: reference/project_bwd.rs, reference/adam.rs; method 2.4, "per splat, once", and 4.1). Invisible splats step in the
// next `project`.
// GEOMETRY: also the sums by depth and normal.
// Workgroup: GROUP visible splats. Invocation: a visible splat.

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
@group(0) @binding(6) var<storage, read> splat_totals: array<f32>; // [visible, partial_stride]
@group(0) @binding(7) var<storage, read_write> statistics: array<vec4f>; // [n] seen, area, weight, error
@group(0) @binding(8) var<storage, read> visible: array<u32>; // [1 + n] number of visible splats, then these, ascending

// The first of the splat's sums and of its parameters, and its gradients that were not finite.
var<private> first_sum: u32;
var<private> first_parameter: u32;
var<private> num_faults: u32;

// `sum` is one of pair_sums that the variant has, below partial_stride.
fn sum_at(sum: u32) -> f32 {
    return splat_totals[first_sum + sum];
}

fn sums_at(sum: u32) -> vec3f {
    return vec3f(sum_at(sum), sum_at(sum + 1u), sum_at(sum + 2u));
}

// Three floats of the splat's parameters, from float f on.
fn vec3_at(f: u32) -> vec3f {
    let at = first_parameter + f;
    return vec3f(splat_p[at], splat_p[at + 1u], splat_p[at + 2u]);
}

// A step of Adam on float f of the splat's parameters.
fn update(f: u32, gradient: f32, rate: f32) {
    var by = gradient;
    if !is_finite(by) {
        by = 0.0;
        num_faults += 1u;
    }
    let at = first_parameter + f;
    var now = adam_step(Moments(splat_p[at], splat_m[at], splat_v[at]), by, rate);
    if f >= LOG_SCALE && f < OPACITY {
        now.p = clamp(now.p, LOG_SCALE_MIN, LOG_SCALE_MAX);
    }
    splat_p[at] = now.p;
    splat_m[at] = now.m;
    splat_v[at] = now.v;
}

fn update3(f: u32, gradient: vec3f, rate: f32) {
    update(f, gradient.x, rate);
    update(f + 1u, gradient.y, rate);
    update(f + 2u, gradient.z, rate);
}

// A step on all parameters but SH.
fn update_shape(by_position: vec3f, by_q: vec4f, by_log_scales: vec2f, by_logit: f32) {
    update3(POSITION, by_position, step.rate_position);
    update(QUATERNION, by_q.x, step.rate_quaternion);
    update3(QUATERNION + 1u, by_q.yzw, step.rate_quaternion);
    update(LOG_SCALE, by_log_scales.x, step.rate_log_scale);
    update(LOG_SCALE + 1u, by_log_scales.y, step.rate_log_scale);
    update(OPACITY, by_logit, step.rate_opacity);
}

// Derivatives with respect to the centre and the surfel axes in camera axes, and from there by the stored parameters.
fn chain_rule(i: u32) {
    let s = projected[i];
    let position = vec3_at(POSITION);
    let p = in_camera(position) + camera_translation();
    let q_at = first_parameter + QUATERNION;
    let q = vec4f(splat_p[q_at], splat_p[q_at + 1u], splat_p[q_at + 2u], splat_p[q_at + 3u]);
    let axes = rotation_of(q);
    let e_u = in_camera(axes[0]);
    let e_v = in_camera(axes[1]);
    let n = in_camera(axes[2]);
    let scales = exp(vec2f(splat_p[q_at + 4u], splat_p[q_at + 5u]));
    let w0 = dot(p, n) / p.z;
    let per_px = 1.0 / (step.focal_px * w0);

    let u = sums_at(SUM_U);
    let v = sums_at(SUM_V);
    let d = sums_at(SUM_D);
    // The map in standard deviations is the map in local units over sigma.
    let sigma_a = cross(e_v, p).xy * per_px / scales.x;
    let sigma_b = cross(p, e_u).xy * per_px / scales.y;
    let spread = splat_spread(sigma_a, sigma_b, map_determinant(per_px, scales, p.z));
    let by_thinning = sum_at(SUM_FALLOFF) * s.opacity;
    let by_spread = spread_bwd(spread, by_thinning);
    let through = step.filter_px2;
    let by_a = (u.yz - v.yz * spread.v_a / spread.v_b) / spread.u_a
        + through * (by_spread.x * sigma_a + by_spread.y * sigma_b);
    let by_b = v.yz / spread.v_b + through * (by_spread.y * sigma_a + by_spread.z * sigma_b);
    let by_cross_a = vec3f(by_a * per_px / scales.x, 0.0);
    let by_cross_b = vec3f(by_b * per_px / scales.y, 0.0);
    let by_w0 = -(dot(by_a, sigma_a) + dot(by_b, sigma_b) + dot(d.yz, s.g)) / w0;
#if GEOMETRY
    let by_facing = sums_at(SUM_NORMAL);
    let by_n = vec3f(d.yz * per_px, 0.0) + by_w0 * p / p.z + select(by_facing, -by_facing, w0 > 0.0);
#else
    let by_n = vec3f(d.yz * per_px, 0.0) + by_w0 * p / p.z;
#endif
    let by_px = -(s.a * u.x + s.b * v.x + s.g * d.x) * step.focal_px / p.z;
#if GEOMETRY
    let by_projection = vec3f(by_px, -(sum_at(SUM_DEPTH) + dot(by_px, p.xy)) / p.z);
#else
    let by_projection = vec3f(by_px, -dot(by_px, p.xy) / p.z);
#endif
    let by_plane = (n - vec3f(0.0, 0.0, w0)) / p.z;
    let by_centre = cross(by_cross_a, e_v) + cross(e_u, by_cross_b) + by_w0 * by_plane + by_projection;
    let by_axes = mat3x3f(in_local(cross(by_cross_b, p)), in_local(cross(p, by_cross_a)), in_local(by_n));

    let by_position = in_local(by_centre) + sh_bwd(i, position, s.rgb);
    let opacity = bounds[i].opacity;
    let by_logit = (by_thinning + step.opacity_weight * opacity) * (1.0 - opacity);
    let by_log_scales = by_spread.xz + by_thinning;
    update_shape(by_position, quaternion_bwd(q, by_axes), by_log_scales, by_logit);
}

// Derivative with respect to the spread's covariance, times 2: entries uu, uv, vv. The opacity is divided by the root of
// the covariance's determinant.
fn spread_bwd(spread: Spread, by_thinning: f32) -> vec3f {
    let sums = sums_at(SUM_EXPONENT);
    let aa = sums.x - by_thinning;
    let ab = sums.y;
    let bb = sums.z - by_thinning;
    let vv = bb / (spread.v_b * spread.v_b);
    let uv = (ab / spread.v_b - spread.v_a * vv) / spread.u_a;
    let uu = (aa / spread.u_a - spread.v_a * (ab / (spread.u_a * spread.v_b) + uv)) / spread.u_a;
    return vec3f(uu, uv, vv);
}

// Steps on the SH and returns the derivative with respect to the position through the view direction. SH of degrees not in
// use take no step.
fn sh_bwd(i: u32, position: vec3f, rgb: vec3f) -> vec3f {
    let degree = min(step.sh_degree, sh_degree(bounds[i].parameters));
    let by_rgb = select(vec3f(0.0), sums_at(SUM_RGB), rgb > vec3f(0.0));
    let offset = position - step.camera_in_local;
    let distance = length(offset);
    let direction = offset / distance;
    let basis = sh_basis(degree, direction);
    let slopes = sh_basis_derivative(degree, direction);
    var by_direction = vec3f(0.0);
    // The splat has these: `degree` is at most its own, which is at most 3.
    for (var k = 0u; k < sh_coefficients(degree); k += 1u) {
        by_direction += slopes[k] * dot(vec3_at(SH + 3u * k), by_rgb);
        let rate = select(step.rate_sh_rest, step.rate_sh_dc, k == 0u);
        update3(SH + 3u * k, basis[k] * by_rgb, rate);
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

@compute @workgroup_size(GROUP)
fn project_bwd(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = group_index(group, groups) * GROUP + lane;
    if place >= visible[0] {
        return;
    }
    // The list holds splats of the model.
    let i = visible[1u + place];
    first_sum = place * step.partial_stride;
    first_parameter = first_float(bounds[i].parameters);
    chain_rule(i);
    bounds[i].faults = num_faults + u32(sum_at(SUM_FAULTS));
    if has_flag(FLAG_STATISTICS) {
        let num_pixels = f32(step.size_px.x * step.size_px.y);
        // With this flag, partial_stride is PAIR_SUMS_STATISTICS or more.
        statistics[i] += vec4f(1.0, sums_at(SUM_STATISTICS) / num_pixels);
    }
}
