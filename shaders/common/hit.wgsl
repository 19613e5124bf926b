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

// Bilinear taps: the first texel, whose row or column may be -1, and the fractions.
struct Taps {
    inside: bool,
    coordinate: vec2f,
    first: vec2i,
    fraction: vec2f,
}

fn texture_taps(s: Projected, plane: vec2f) -> Taps {
    let size = vec2f(f32(map_rows(s.map_size)), f32(map_cols(s.map_size)));
    let coordinate = in_texels(s, plane) + (size - 1.0) * 0.5;
    let inside = size.x > 0.0 && all(coordinate >= vec2f(-1.0)) && all(coordinate < size);
    let whole = floor(clamp(coordinate, vec2f(-1.0), size));
    return Taps(inside, coordinate, vec2i(whole), coordinate - whole);
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

// Residuals of the four taps, row by row.
fn tap_values(s: Projected, taps: Taps) -> array<vec3f, 4> {
    return array(
        tap(s, taps.first),
        tap(s, taps.first + vec2i(0, 1)),
        tap(s, taps.first + vec2i(1, 0)),
        tap(s, taps.first + vec2i(1, 1)),
    );
}

fn residual(values: array<vec3f, 4>, fraction: vec2f) -> vec3f {
    let upper = values[0] * (1.0 - fraction.y) + values[1] * fraction.y;
    let lower = values[2] * (1.0 - fraction.y) + values[3] * fraction.y;
    return upper * (1.0 - fraction.x) + lower * fraction.x;
}
