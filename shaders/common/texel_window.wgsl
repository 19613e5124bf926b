// The texels that the taps of a splat can touch within a tile. The map from pixels to texels is
// projective, so its extremes over a rectangle lie at the corners as long as the denominator is positive there.

struct Window {
    first: vec2u,
    past: vec2u,
}

// The window of a smaller map is the whole map: one block, or hardly more.
const WHOLE_MAP_TEXELS = 16u;

fn texel_window(s: Projected, origin_px: vec2u) -> Window {
    let size = vec2u(map_rows(s.map_size), map_cols(s.map_size));
    if size.x * size.y <= WHOLE_MAP_TEXELS {
        return Window(vec2u(0u), size);
    }
    let low_px = max(vec2f(unpack_px(s.box_min)), vec2f(origin_px)) - s.centre_px;
    let high_px = min(vec2f(unpack_px(s.box_max)), vec2f(origin_px + TILE_SIZE_PX)) - s.centre_px;
    var low = vec2f(1e30);
    var high = vec2f(-1e30);
    var least = 1.0;
    for (var corner = 0u; corner < 4u; corner += 1u) {
        let offset = select(low_px, high_px, vec2<bool>((corner & 1u) != 0u, (corner & 2u) != 0u));
        let denominator = 1.0 + dot(s.g, offset);
        let plane = vec2f(dot(s.a, offset), dot(s.b, offset)) / denominator;
        let texel = texture_coordinate(s, plane);
        least = min(least, denominator);
        low = min(low, texel);
        high = max(high, texel);
    }
    if least < 1e-2 {
        return Window(vec2u(0u), size);
    }
    // 0.01 texels of slack for rounding.
    let limit = vec2f(size);
    let reach = texel_reach(s) + 0.01;
    let first = clamp(ceil(low - reach), vec2f(0.0), limit);
    let past = clamp(floor(high + reach) + 1.0, first, limit);
    return Window(vec2u(first), vec2u(past));
}
