// The pixel of a tile that an invocation computes: 32 consecutive invocations cover 8 x 4 pixels, so that
// subgroups of any size stay compact.

const TILE_SIZE_PX = vec2u(TILE_PX, TILE_ROWS_PX);

fn tile_origin_px(tile: u32) -> vec2u {
    return vec2u(tile % step.grid.x, tile / step.grid.x) * TILE_SIZE_PX;
}

fn pixel_in_tile(lane: u32) -> vec2u {
    let part = lane >> 5u;
    return vec2u((lane & 7u) + (part & 1u) * 8u, ((lane >> 3u) & 3u) + (part >> 1u) * 4u);
}
