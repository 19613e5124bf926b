// Adds texel gradients to memory by atomics, in fixed point. Requires `texel_grad` bound. The functions return
// the number of faults, or with COUNT the number of atomics. SCATTER: also defines `scatter`.

#if SCATTER
// Adds the gradient of a sample to its taps.
fn scatter(s: Projected, taps: Taps, by_colour: vec3f) -> u32 {
    let units = texel_units(s.box_min, s.box_max);
    let by_texels = by_colour * per_footprint(s);
    var faults = 0u;
    for (var i = max(taps.first.x, 0); i < taps.past.x; i += 1) {
        for (var j = max(taps.first.y, 0); j < taps.past.y; j += 1) {
            let length = overlap(taps.coordinate - vec2f(f32(i), f32(j)), taps.reach);
            faults += add_texel(s, units, vec2i(i, j), by_texels * (length.x * length.y));
        }
    }
    return faults;
}

fn add_texel(s: Projected, units: f32, texel: vec2i, by_texel: vec3f) -> u32 {
    let cols = i32(map_cols(s.map_size));
    if texel.x < 0 || texel.y < 0 || texel.x >= i32(map_rows(s.map_size)) || texel.y >= cols {
        return 0u;
    }
    let at = 3u * (s.map_offset_texels + u32(texel.x * cols + texel.y));
    let limit = fixed_limit(units, 1u);
    return add_fixed(at, by_texel.x, units, limit) + add_fixed(at + 1u, by_texel.y, units, limit)
        + add_fixed(at + 2u, by_texel.z, units, limit);
}
#endif

// Adds to one channel of the gradient of a texel, which lies within its map. A value that is not finite or exceeds the limit is a
// fault: it counts as zero, or is clamped.
fn add_fixed(at: u32, by_texel: f32, units: f32, limit: f32) -> u32 {
    let value = by_texel * units;
    let fits = is_finite(value) && abs(value) <= limit;
    let fixed = i32(round(select(0.0, clamp(value, -limit, limit), is_finite(value))));
    if fixed != 0 {
        atomicAdd(&texel_grad[at], fixed);
    }
#if COUNT
    return u32(fixed != 0);
#else
    return u32(!fits);
#endif
}
