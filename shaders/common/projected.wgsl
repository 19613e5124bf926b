// A splat projected to a view. With d the offset of a pixel from the projected centre and D = 1 + g . d, the
// pixel's ray hits the surfel's plane at (a . d, b . d) / D, at the depth of the centre over D. In these coordinates the
// filtered falloff is round: exp(-(x^2 + y^2) / 2). Without a filter they are standard deviations along u and v.

struct Projected {
    centre_px: vec2f,
    a: vec2f,
    b: vec2f,
    g: vec2f,
    // Base colour before the clamp at zero; never NaN.
    rgb: vec3f,
    // After the filter.
    opacity: f32,
    // Texels along u per x; along v per x and per y.
    texels_per_coordinate: vec3f,
    near_over_depth: f32,
    // rows | cols << 16
    map_size: u32,
    map_offset_texels: u32,
    // First pixel of the box, and one past the last: x | y << 16
    box_min: u32,
    box_max: u32,
    // Size of the area that a sample takes the mean of the map over, along rows and columns; 1: bilinear interpolation.
    footprint_texels: vec2f,
    // Texture coordinates of the splat's centre.
    map_origin: vec2f,
}

// Texture coordinates of a point: those of the centre of row i and column j are (i, j).
fn texture_coordinate(s: Projected, plane: vec2f) -> vec2f {
    let t = s.texels_per_coordinate;
    return s.map_origin + vec2f(t.x * plane.x, t.y * plane.x + t.z * plane.y);
}

// Distance along rows and columns at which a texel's weight ends.
fn texel_reach(s: Projected) -> vec2f {
    return 0.5 * (s.footprint_texels + 1.0);
}

// 1 over the area of the footprint.
fn per_footprint(s: Projected) -> f32 {
    return 1.0 / (s.footprint_texels.x * s.footprint_texels.y);
}

// A pair of tile and splat, in the order of tiles and depth, has three entries in `pairs`, `pair_capacity` apart: the splat;
// the window of texels that the tile can touch, the first row and column as row | col << 16; one past the last. For the backward
// pass by subgroups, which needs no windows, only the first (common/segments).
fn window_first_at(pair: u32) -> u32 {
    return step.pair_capacity + pair;
}

fn window_past_at(pair: u32) -> u32 {
    return 2u * step.pair_capacity + pair;
}

fn unpack_px(packed: u32) -> vec2i {
    return vec2i(i32(packed & 0xffffu), i32(packed >> 16u));
}

fn pack_px(v: vec2i) -> u32 {
    return u32(v.x) | (u32(v.y) << 16u);
}
