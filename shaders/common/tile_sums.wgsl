// Partial sums over the pixels of a tile, from the quantities that they stored in workgroup memory: those of a
// pair, and the gradients of a block of texels. Requires the declarations of raster_bwd. Each function is one
// invocation's share. Rows lie below PARTS = TILE_ROWS_PX, and columns below TILE_PX: the caller clips both to the tile.

// Sums one quantity, U to D or RED and the two after it, over a row of pixels; the first three also times dx and dy.
fn sum_row(quantity: u32, row: u32, columns: vec2u, to_first: vec2f) {
    var total = 0.0;
    var times_dx = 0.0;
    for (var column = columns.x; column < columns.y; column += 1u) {
        let value = lanes[quantity * RASTER_GROUP + column * PARTS + row];
        total += value;
        times_dx += value * (to_first.x + f32(column));
    }
    let sum = select(SUM_RGB + quantity - RED, SUM_U + quantity * 3u, quantity < 3u);
    sum_parts[sum * PARTS + row] = total;
    if quantity < 3u {
        sum_parts[(sum + 1u) * PARTS + row] = times_dx;
        sum_parts[(sum + 2u) * PARTS + row] = total * (to_first.y + f32(row));
    }
}

// Sums the derivative with respect to the exponent times products of the coordinates, and that by the opacity, over a
// row of pixels.
fn exponent_row(s: Projected, row: u32, columns: vec2u) {
    var total = vec4f(0.0);
    for (var column = columns.x; column < columns.y; column += 1u) {
        let at = column * PARTS + row;
        let by_falloff = lanes[FALLOFF * RASTER_GROUP + at];
        let x = lanes[PLANE_X * RASTER_GROUP + at];
        let y = lanes[PLANE_Y * RASTER_GROUP + at];
        total += by_falloff * vec4f(s.opacity * vec3f(x * x, x * y, y * y), 1.0);
    }
    for (var k = 0u; k < 4u; k += 1u) {
        sum_parts[(SUM_EXPONENT + k) * PARTS + row] = total[k];
    }
}

#if STATISTICS
// Sums pixels, blending weight and weight times loss over a row of pixels.
fn statistics_row(row: u32, columns: vec2u, origin_px: vec2u) {
    var total = vec3f(0.0);
    for (var column = columns.x; column < columns.y; column += 1u) {
        let at = column * PARTS + row;
        let weight = lanes[WEIGHT * RASTER_GROUP + at];
        // In bounds: the box lies within the image.
        let loss = pixel_loss(origin_px + vec2u(column, row));
        total += vec3f(f32(weight > 0.0), weight, weight * loss);
    }
    for (var k = 0u; k < 3u; k += 1u) {
        sum_parts[(SUM_STATISTICS + k) * PARTS + row] = total[k];
    }
}
#endif

#if GEOMETRY
// Sums the derivative with respect to m, times m, and the derivative with respect to the normal over a row of pixels.
fn geometry_row(s: Projected, row: u32, columns: vec2u, origin_px: vec2u) {
    var total = vec4f(0.0);
    for (var column = columns.x; column < columns.y; column += 1u) {
        let weight = lanes[WEIGHT * RASTER_GROUP + column * PARTS + row];
        let pixel = origin_px + vec2u(column, row);
        // In bounds: the box lies within the image.
        let at = 3u * (pixel.y * step.size_px.x + pixel.x);
        let c = pixel_records[at + 1u].xyz;
        let m = s.near_over_depth * (1.0 + dot(s.g, vec2f(pixel) + 0.5 - s.centre_px));
        total += weight * vec4f((c.y + 2.0 * c.z * m) * m, pixel_records[at + 2u].xyz);
    }
    for (var k = 0u; k < 4u; k += 1u) {
        sum_parts[(SUM_DEPTH + k) * PARTS + row] = total[k];
    }
}
#endif

// Sums the gradients of a row of four texels of a block over every TEXEL_PARTS-th row of pixels; `texel_row` lies below
// BLOCK_TEXELS, and `part` below TEXEL_PARTS.
fn gather_row(s: Projected, first: vec2u, texel_row: u32, part: u32, low: vec2u, high: vec2u) {
    var red = vec4f(0.0);
    var green = vec4f(0.0);
    var blue = vec4f(0.0);
    let reach = texel_reach(s);
    let per_area = per_footprint(s);
    let u = f32(first.x + texel_row);
    let v = f32(first.y) + vec4f(0.0, 1.0, 2.0, 3.0);
    for (var y = part; y < high.y; y += TEXEL_PARTS) {
        for (var x = select(low.x, high.x, y < low.y); x < high.x; x += 1u) {
            let at = x * PARTS + y;
            let along_u = clamp(reach.x - abs(lanes[TEXEL_U * RASTER_GROUP + at] - u), 0.0, 1.0);
            let to_v = reach.y - abs(lanes[TEXEL_V * RASTER_GROUP + at] - v);
            let w = along_u * clamp(to_v, vec4f(0.0), vec4f(1.0));
            red += w * lanes[RED * RASTER_GROUP + at];
            green += w * lanes[(RED + 1u) * RASTER_GROUP + at];
            blue += w * lanes[(RED + 2u) * RASTER_GROUP + at];
        }
    }
    for (var k = 0u; k < BLOCK_TEXELS; k += 1u) {
        let at = (texel_row * BLOCK_TEXELS + k) * 3u * TEXEL_PARTS + part;
        texel_parts[at] = per_area * red[k];
        texel_parts[at + TEXEL_PARTS] = per_area * green[k];
        texel_parts[at + 2u * TEXEL_PARTS] = per_area * blue[k];
    }
}
