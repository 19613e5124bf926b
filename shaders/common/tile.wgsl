// Which pixel of a tile an invocation has: 32 invocations in a row cover 8 x 4 pixels, so
// that subgroups stay compact whatever their size.

const TILE_SIZE_PX = vec2u(TILE_PX, TILE_ROWS_PX);

fn tile_origin_px(tile: u32) -> vec2u {
    return vec2u(tile % step.grid.x, tile / step.grid.x) * TILE_SIZE_PX;
}

fn pixel_in_tile(lane: u32) -> vec2u {
    let part = lane >> 5u;
    return vec2u((lane & 7u) + (part & 1u) * 8u, ((lane >> 3u) & 3u) + (part >> 1u) * 4u);
}
