// Pixels of the image by their place in a tile of the loss.

// Index of pixels outside the image.
const OUTSIDE = 0xffffffffu;

// Index of the pixel at an offset from the tile's first pixel.
fn image_pixel(tile: u32, offset: vec2i) -> u32 {
    let px = vec2i(vec2u(tile % step.grid.x, tile / step.grid.x) * TILE_PX) + offset;
    let inside = all(px >= vec2i(0)) && all(px < vec2i(step.size_px));
    return select(OUTSIDE, u32(px.y) * step.size_px.x + u32(px.x), inside);
}
