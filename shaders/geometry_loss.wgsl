// Distortion and normal terms (twin: reference/geometry.rs; method 3): their values, summed per tile, and for each
// pixel a record for the backward pass, with the coefficients of their derivatives. Surface normals are constants in
// the derivative.
// Workgroup: a tile. Invocation: a pixel.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/photo
#include common/tile

@group(0) @binding(1) var<storage, read> geometry: array<vec4f>; // [P, 2] by raster_fwd
@group(0) @binding(2) var<storage, read> pixel_state: array<vec2u>; // [P] transmittance, one past the last blended pair
@group(0) @binding(3) var<storage, read> tile_ranges: array<vec2u>; // [tiles] of pairs
@group(0) @binding(4) var<storage, read> photo: array<u32>; // [pool], see common/photo
@group(0) @binding(5) var<storage, read> pixel_grad: array<vec4f>; // [P] by rgb; loss of the pixel
// [P, 3] by rgb, loss; constant, linear, square, transmittance; towards x, y, z, number of pairs up to the last
// blended one. The number is converted, not bit-cast: as a float, a small integer's bits are a denormal and may
// be flushed.
@group(0) @binding(6) var<storage, read_write> pixel_records: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> geometry_partials: array<vec2f>; // [tiles] distortion, normal

var<workgroup> sums: array<vec2f, RASTER_GROUP>;

// Depth of a pixel; 0 where its alpha is below SURFACE_ALPHA_MIN.
fn surface_depth(pixel: vec2u) -> f32 {
    let at = pixel.y * step.size_px.x + pixel.x;
    let alpha = 1.0 - bitcast<f32>(pixel_state[at].x);
    return select(0.0, geometry[2u * at].w / max(alpha, SURFACE_ALPHA_MIN), alpha >= SURFACE_ALPHA_MIN);
}

// Normal of the depth map by central differences, in camera axes, facing the camera; zero at the border and
// where a neighbour is not opaque. With r the ray of the pixel, its neighbours' points are (r +- e / focal)
// depth. The formula subtracts depths rather than points, whose rounding errors a difference would magnify.
fn surface_normal(pixel: vec2u) -> vec3f {
    if any(pixel < vec2u(1u)) || any(pixel + 1u >= step.size_px) {
        return vec3f(0.0);
    }
    let left = surface_depth(pixel - vec2u(1u, 0u));
    let right = surface_depth(pixel + vec2u(1u, 0u));
    let above = surface_depth(pixel - vec2u(0u, 1u));
    let below = surface_depth(pixel + vec2u(0u, 1u));
    let ray = vec3f((vec2f(pixel) + 0.5 - step.principal_px) / step.focal_px, 1.0);
    let along_x = ray * (right - left) + vec3f((right + left) / step.focal_px.x, 0.0, 0.0);
    let along_y = ray * (below - above) + vec3f(0.0, (below + above) / step.focal_px.y, 0.0);
    let normal = cross(along_y, along_x);
    let size = length(normal);
    let opaque = min(min(left, right), min(above, below)) > 0.0 && surface_depth(pixel) > 0.0;
    if !opaque || !is_finite(size) || size < 1e-30 {
        return vec3f(0.0);
    }
    return select(normal, -normal, dot(normal, ray) > 0.0) / size;
}

// Writes the record of a pixel and returns the values of both terms there.
fn pixel_loss(pixel: vec2u, first_pair: u32) -> vec2f {
    let at = pixel.y * step.size_px.x + pixel.x;
    let state = pixel_state[at];
    let transmittance = bitcast<f32>(state.x);
    let alpha = 1.0 - transmittance;
    let per = 1.0 / f32(step.size_px.x * step.size_px.y);
    let moments = geometry[2u * at + 1u].xy;
    var values = vec2f(0.0);
    var by_moments = vec3f(0.0);
    var towards = vec3f(0.0);
    // Masked pixels count as 0.
    if photo_counts(photo[step.photo_offset_px + at]) {
        values.x = alpha * moments.y - moments.x * moments.x;
        by_moments = per * step.loss_distortion * vec3f(moments.y, -2.0 * moments.x, alpha);
        let surface = surface_normal(pixel);
        if any(surface != vec3f(0.0)) {
            values.y = alpha - dot(geometry[2u * at].xyz, surface);
            by_moments.x += per * step.loss_normal;
            towards = -per * step.loss_normal * surface;
        }
    }
    pixel_records[3u * at] = pixel_grad[at];
    pixel_records[3u * at + 1u] = vec4f(by_moments, transmittance);
    pixel_records[3u * at + 2u] = vec4f(towards, f32(state.y - first_pair));
    return values;
}

@compute @workgroup_size(RASTER_GROUP)
fn geometry_loss(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = group_index(group, groups);
    if tile >= step.grid.x * step.grid.y {
        return;
    }
    let pixel = tile_origin_px(tile) + pixel_in_tile(lane);
    var values = vec2f(0.0);
    if all(pixel < step.size_px) {
        values = pixel_loss(pixel, tile_ranges[tile].x);
    }
    sums[lane] = values;
    workgroupBarrier();
    for (var half = RASTER_GROUP / 2u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        geometry_partials[tile] = sums[0];
    }
}
