// Intersection of a pixel's ray with a splat, alpha there, and the texture taps. Forward and backward pass call
// the same functions and so get the same bits (twin: reference/raster_fwd.rs; method 2.2). Requires
// `texel_values` bound.

struct Hit {
    inside: bool,
    offset_px: vec2f,
    per_denominator: f32,
    denominator: f32,
    // Coordinates on the surfel in which the falloff is round.
    plane: vec2f,
    falloff: f32,
    // opacity * falloff, before the clamp
    raw_alpha: f32,
}

fn in_box(s: Projected, pixel: vec2u) -> bool {
    let low = vec2u(s.box_min & 0xffffu, s.box_min >> 16u);
    let high = vec2u(s.box_max & 0xffffu, s.box_max >> 16u);
    return all(pixel >= low) && all(pixel < high);
}

fn splat_hit(s: Projected, pixel_px: vec2f) -> Hit {
    let offset_px = pixel_px - s.centre_px;
    let denominator = 1.0 + dot(s.g, offset_px);
    // `inside` excludes hits behind the camera: there, any positive divisor will do.
    let per_denominator = 1.0 / max(denominator, DENOMINATOR_MIN);
    let plane = vec2f(dot(s.a, offset_px), dot(s.b, offset_px)) * per_denominator;
    let falloff = exp(-0.5 * dot(plane, plane));
    let raw_alpha = s.opacity * falloff;
    let inside = denominator >= DENOMINATOR_MIN && s.near_over_depth * denominator <= 1.0
        && raw_alpha >= ALPHA_MIN;
    return Hit(inside, offset_px, per_denominator, denominator, plane, falloff, raw_alpha);
}

// The texture coordinate of a sample, and the texels that it takes part of; `first` may be outside the map.
struct Taps {
    inside: bool,
    coordinate: vec2f,
    first: vec2i,
    past: vec2i,
    // Distance along rows and columns at which a texel's weight ends.
    reach: vec2f,
}

fn texture_taps(s: Projected, plane: vec2f) -> Taps {
    let size = vec2f(f32(map_rows(s.map_size)), f32(map_cols(s.map_size)));
    let coordinate = texture_coordinate(s, plane);
    let reach = texel_reach(s);
    let inside = size.x > 0.0 && all(coordinate > -reach) && all(coordinate < size - 1.0 + reach);
    let first = vec2i(ceil(clamp(coordinate - reach, vec2f(-1.0), size)));
    let past = vec2i(floor(clamp(coordinate + reach, vec2f(-1.0), size))) + 1;
    return Taps(inside, coordinate, first, past, reach);
}

fn is_minified(s: Projected) -> bool {
    return max(s.footprint_texels.x, s.footprint_texels.y) > 1.0;
}

// A residual and its derivatives with respect to the texture coordinate.
struct Residual {
    value: vec3f,
    by_u: vec3f,
    by_v: vec3f,
}

// Residual at the taps. With maps that are not minified: bilinear interpolation.
fn residual(s: Projected, taps: Taps) -> Residual {
    if is_minified(s) {
        return mean_residual(s, taps);
    }
    let first = floor(taps.coordinate);
    let f = taps.coordinate - first;
    let t00 = tap(s, vec2i(first));
    let t01 = tap(s, vec2i(first) + vec2i(0, 1));
    let t10 = tap(s, vec2i(first) + vec2i(1, 0));
    let t11 = tap(s, vec2i(first) + vec2i(1, 1));
    let by_u = (1.0 - f.y) * (t10 - t00) + f.y * (t11 - t01);
    let by_v = (1.0 - f.x) * (t01 - t00) + f.x * (t11 - t10);
    let upper = t00 * (1.0 - f.y) + t01 * f.y;
    let lower = t10 * (1.0 - f.y) + t11 * f.y;
    return Residual(upper * (1.0 - f.x) + lower * f.x, by_u, by_v);
}

// The mean over a footprint of more than a texel.
fn mean_residual(s: Projected, taps: Taps) -> Residual {
    var out = Residual(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    let per_area = per_footprint(s);
    for (var i = max(taps.first.x, 0); i < taps.past.x; i += 1) {
        for (var j = max(taps.first.y, 0); j < taps.past.y; j += 1) {
            let value = per_area * tap(s, vec2i(i, j));
            let d = taps.coordinate - vec2f(f32(i), f32(j));
            let length = overlap(d, taps.reach);
            let on_edge = (length > vec2f(0.0)) & (abs(d) >= taps.reach - 1.0);
            let slope = select(vec2f(0.0), -sign(d), on_edge);
            out.value += length.x * length.y * value;
            out.by_u += slope.x * length.y * value;
            out.by_v += length.x * slope.y * value;
        }
    }
    return out;
}

// Length of a texel within a footprint whose centre is `d` away, along rows and columns.
fn overlap(d: vec2f, reach: vec2f) -> vec2f {
    return clamp(reach - abs(d), vec2f(0.0), vec2f(1.0));
}

// Residual of a texel; zero outside the map.
fn tap(s: Projected, texel: vec2i) -> vec3f {
    let rows = i32(map_rows(s.map_size));
    let cols = i32(map_cols(s.map_size));
    if texel.x < 0 || texel.y < 0 || texel.x >= rows || texel.y >= cols {
        return vec3f(0.0);
    }
    return texel_values[s.map_offset_texels + u32(texel.x * cols + texel.y)].xyz;
}
