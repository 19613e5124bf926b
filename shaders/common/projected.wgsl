// A splat as one view sees it. With d the offset of a pixel from the projected centre and D = 1 + g . d, the
// ray hits the plane at (a . d, b . d) / D standard deviations, at depth / D. Mirrors `layout::Projected`.

struct Projected {
    centre_px: vec2f,
    a: vec2f,
    b: vec2f,
    g: vec2f,
    // Base colour before its clamp at zero; never NaN.
    rgb: vec3f,
    opacity: f32,
    texels_per_sigma: vec2f,
    near_over_depth: f32,
    // rows | cols << 16
    map_size: u32,
    map_offset_texels: u32,
    // x | y << 16 of the first pixel of the box, and of the one past the last.
    box_min: u32,
    box_max: u32,
    // Units of fixed point per unit of texel gradient.
    texel_units: f32,
}

// A splat in a tile is two records in `pairs`: x is its slot, the place among the splat's own pairs, unsorted,
// where its partial sums go; y is the splat. So many records further, as pairs fit, stands the window of texels
// that the tile can touch: x the first row and column, row | col << 16, y one past the last.
fn window_at(pair: u32) -> u32 {
    return step.pair_capacity + pair;
}

fn unpack_px(packed: u32) -> vec2i {
    return vec2i(i32(packed & 0xffffu), i32(packed >> 16u));
}

fn pack_px(v: vec2i) -> u32 {
    return u32(v.x) | (u32(v.y) << 16u);
}
