// Projects every splat to the view: bounds, number of tiles, depth key and base colour (twin: reference/project.rs;
// method 1.2, 2.2, 2.3, 2.5); lists the visible ones of each group. Flushes the SH of visible splats on the way.
// FLAG_INVISIBLE: first does the previous step for splats that were invisible in it. FLAG_NO_VIEW: nothing else.
// GEOMETRY: also writes normals.
// Workgroup: GROUP splats. Invocation: a splat.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/splat
#include common/projected
#include common/bounds
#include common/filter
#include common/adam
#include common/sh
#include common/list_group
#include common/invisible

@group(0) @binding(1) var<storage, read_write> splat_p: array<f32>; // [num_splat_floats]
@group(0) @binding(2) var<storage, read_write> splat_m: array<f32>; // [num_splat_floats]
@group(0) @binding(3) var<storage, read_write> splat_v: array<f32>; // [num_splat_floats]
@group(0) @binding(4) var<storage, read> splat_info: array<SplatInfo>; // [n]
@group(0) @binding(5) var<storage, read_write> projected: array<Projected>; // [n]
@group(0) @binding(6) var<storage, read_write> bounds: array<Bounds>; // [n]
@group(0) @binding(7) var<storage, read_write> group_lists: array<u32>; // common/group_lists
#if GEOMETRY
@group(0) @binding(8) var<storage, read_write> normals: array<vec4f>; // [n] camera axes, facing the camera
#endif

@compute @workgroup_size(GROUP)
fn project(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_index(group, groups);
    let i = block * GROUP + lane;
    clear_list(lane);
    var num_tiles = 0u;
    if i < step.num_splats {
        if has_flag(FLAG_INVISIBLE) && bounds[i].depth_key == INVISIBLE_KEY {
            step_invisible(first_float(splat_info[i].parameters));
        }
        if !has_flag(FLAG_NO_VIEW) {
            num_tiles = project_splat(i);
        }
    }
    list_splat(block, lane, num_tiles);
}

// Returns the number of tiles that the splat touches.
fn project_splat(i: u32) -> u32 {
    let base = first_float(splat_info[i].parameters);
    let position = vec3f(splat_p[base], splat_p[base + 1u], splat_p[base + 2u]);
    let p = in_camera(position) + camera_translation();
    let scales = exp(vec2f(splat_p[base + LOG_SCALE], splat_p[base + LOG_SCALE + 1u]));
    let stored_opacity = sigmoid(splat_p[base + OPACITY]);
    let q = base + QUATERNION;
    let axes = rotation_of(vec4f(splat_p[q], splat_p[q + 1u], splat_p[q + 2u], splat_p[q + 3u]));
    let e_u = in_camera(axes[0]);
    let e_v = in_camera(axes[1]);
    let n = in_camera(axes[2]);
    let p_n = dot(p, n);
    let w0 = p_n / p.z;
    let per_px = 1.0 / (step.focal_px * w0);
    let sigma_a = cross(e_v, p).xy * per_px / scales.x;
    let sigma_b = cross(p, e_u).xy * per_px / scales.y;
    let spread = splat_spread(sigma_a, sigma_b, map_determinant(per_px, scales, p.z));
    let a = sigma_a / spread.u_a;
    let b = (sigma_b - spread.v_a * a) / spread.v_b;
    let opacity = stored_opacity * thinning(spread);
    let g = n.xy * per_px;
    let centre_px = step.focal_px * p.xy / p.z + step.principal_px;

    // A sum is finite only if all its terms are.
    let map_sum = a.x + a.y + b.x + b.y + g.x + g.y + centre_px.x + centre_px.y;
    let finite = is_finite(p_n + p.x + p.y + p.z + stored_opacity + scales.x + scales.y) && is_finite(map_sum);
    let drawable = finite && min(scales.x, scales.y) > 1.2e-38 && p.z >= step.near && opacity >= ALPHA_MIN
        && abs(p_n) >= EDGE_ON_MIN * length(p);
    var footprint = empty_bounds();
    if drawable {
        let half_v = e_v * scales.y;
        let half_u = spread.u_a * scales.x * e_u + spread.v_a * half_v;
        footprint = counted_bounds(p, half_u, spread.v_b * half_v, opacity, centre_px);
    }
    footprint.opacity = stored_opacity;
    footprint.parameters = splat_info[i].parameters;
    if footprint.num_tiles == 0u {
        bounds[i] = footprint;
        return 0u;
    }
    footprint.depth_key = min(bitcast<u32>(p.z) - bitcast<u32>(step.near), INVISIBLE_KEY - 1u);
    bounds[i] = footprint;
    let info = splat_info[i];
    // An empty map may have a texel size of zero.
    let texels = select(scales / info.texel_sizes, vec2f(0.0), info.map_size == 0u);
    let per_coordinate = vec3f(texels.x * spread.u_a, texels.y * spread.v_a, texels.y * spread.v_b);
    projected[i] = Projected(
        centre_px,
        a,
        b,
        g,
        base_colour(position, info),
        opacity,
        per_coordinate,
        step.near / p.z,
        info.map_size,
        info.map_offset_texels,
        footprint.box_min,
        footprint.box_max,
        map_footprint(a, b, per_coordinate),
        info.map_origin,
    );
#if GEOMETRY
    normals[i] = vec4f(select(n, -n, p_n > 0.0), 0.0);
#endif
    return footprint.num_tiles;
}

// The bounds of a splat, with its number of tiles.
fn counted_bounds(p: vec3f, half_u: vec3f, half_v: vec3f, opacity: f32, centre_px: vec2f) -> Bounds {
    var out = splat_bounds(p, half_u, half_v, opacity, centre_px);
    let rows = tile_rows(out);
    for (var row = rows.x; row < rows.y; row += 1) {
        let run = tile_run(out, row);
        out.num_tiles += u32(run.y - run.x);
    }
    return out;
}

// Base colour from the flushed SH in the direction from the camera.
fn base_colour(position: vec3f, info: SplatInfo) -> vec3f {
    let skip = adam_skip(info.last_step, step.flushed_step);
    let degree = min(step.sh_degree, sh_degree(info.parameters));
    let basis = sh_basis(degree, normalize(position - step.camera_in_local));
    let used = 3u * sh_coefficients(degree);
    let base = first_float(info.parameters) + SH;
    var rgb = array<f32, 3>(0.5, 0.5, 0.5);
    for (var k = 0u; k < 3u * sh_coefficients(sh_degree(info.parameters)); k += 1u) {
        var value = splat_p[base + k];
        if skip.any {
            let rate = select(step.last_rate_sh_rest, step.last_rate_sh_dc, k < 3u);
            let now = adam_skipped(Moments(value, splat_m[base + k], splat_v[base + k]), skip, rate);
            value = now.p;
            if has_flag(FLAG_PERSIST) {
                splat_p[base + k] = now.p;
                splat_m[base + k] = now.m;
                splat_v[base + k] = now.v;
            }
        }
        if k < used {
            rgb[k % 3u] += basis[k / 3u] * value;
        }
    }
    return vec3f(guarded(rgb[0]), guarded(rgb[1]), guarded(rgb[2]));
}

// Keeps non-finite coefficients from reaching other splats through the loss.
fn guarded(v: f32) -> f32 {
    return select(0.0, clamp(v, -BASE_RGB_MAX, BASE_RGB_MAX), is_finite(v));
}
