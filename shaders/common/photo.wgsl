// Pixels of photos, in the pool as r | g << 8 | b << 16 | alpha << 24 | counts << 31. Requires `step` bound.

fn photo_counts(texel: u32) -> bool {
    return texel >= 0x80000000u;
}

// The photo's colour over the background of the step (twin: `colour` in reference/loss.rs).
fn photo_colour(texel: u32) -> vec3f {
    let behind = f32(127u - ((texel >> 24u) & 127u)) / 127.0;
    return unpack4x8unorm(texel).xyz + behind * step.background;
}
