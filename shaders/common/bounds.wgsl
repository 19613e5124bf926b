// Where a splat can reach alpha 1/255: a box of pixels, and within it an ellipse or the whole box (twin:
// reference/bounds.rs; method 2.3). `project` counts tiles and `tile_emit` lists them, both by `tile_run`.

struct Bounds {
    centre_px: vec2f,
    // 1 / half height; 0 where every row spans the whole box.
    per_half_height: f32,
    // Shift of a span's middle per row.
    shear: f32,
    // Half length of the span through the centre.
    half_span_px: f32,
    // Vertical offset of the rightmost point from the centre; the leftmost point is opposite.
    rightmost_dy_px: f32,
    box_min: u32,
    box_max: u32,
    num_tiles: u32,
    first_slot: u32,
    // Results of the backward pass: gradients that were not finite or did not fit fixed point; ...
    faults: u32,
    // ... sum of the absolute residuals of the map.
    texture_sum: f32,
    // Opacity before the filter.
    opacity: f32,
    // INVISIBLE_KEY if it touches no tile.
    depth_key: u32,
    // Those of its record.
    parameters: u32,
    pad: u32,
}

// Depth key of invisible splats, above all others.
const INVISIBLE_KEY = (1u << DEPTH_KEY_BITS) - 1u;

// Spans are widened by this to absorb rounding (measured on the CPU backend: up to 1e-4 px far from the origin).
const MARGIN_PX = 0.01;

struct Box {
    low: vec2f,
    high: vec2f,
}

fn empty_bounds() -> Bounds {
    return Bounds(vec2f(), 0.0, 0.0, 0.0, 0.0, 0u, 0u, 0u, 0u, 0u, 0.0, 0.0, INVISIBLE_KEY, 0u, 0u);
}

// Sets the box to the pixels whose centres lie in `extent`, widened by the margin and clipped to the image.
fn with_box(bounds: Bounds, extent: Box) -> Bounds {
    let size = vec2f(step.size_px);
    let first = clamp(ceil(extent.low - 0.5 - MARGIN_PX), vec2f(0.0), size);
    let past = clamp(floor(extent.high - 0.5 + MARGIN_PX) + 1.0, vec2f(0.0), size);
    var out = bounds;
    if first.x < past.x && first.y < past.y {
        out.box_min = pack_px(vec2i(first));
        out.box_max = pack_px(vec2i(past));
    }
    return out;
}

// Bounds of a splat: the ellipse that its disc projects to, from homography rows relative to the projected centre, or
// the box of the clipped disc where it reaches the camera plane. The box is empty if no pixel is inside.
// On the ellipse of the conjugate half axes `su` and `sv` the falloff is that of a standard deviation.
fn splat_bounds(p: vec3f, su: vec3f, sv: vec3f, opacity: f32, centre_px: vec2f) -> Bounds {
    let r2 = 2.0 * log(opacity / ALPHA_MIN);
    if r2 < 0.0 {
        return empty_bounds();
    }
    let t0 = step.focal_px * (su.xy - p.xy / p.z * su.z);
    let t1 = step.focal_px * (sv.xy - p.xy / p.z * sv.z);
    let denominator = r2 * (su.z * su.z + sv.z * sv.z) - p.z * p.z;
    if denominator > -CONIC_MARGIN * p.z * p.z {
        return clipped_bounds(p, su * sqrt(r2), sv * sqrt(r2));
    }
    let f = r2 / denominator;
    let offset = (t0 * su.z + t1 * sv.z) * f;
    let half2 = max(offset * offset - (t0 * t0 + t1 * t1) * f, vec2f(0.0));
    let covariance = offset.x * offset.y - (t0.x * t0.y + t1.x * t1.y) * f;
    let half = sqrt(half2);
    let centre = centre_px + offset;
    let height2 = max(half2.y, 1e-37);
    // For needles the difference cancels with an error of order epsilon * half2: widen by that much.
    let span2 = max(half2.x - covariance * covariance / height2, 0.0) + 4e-6 * half2.x;
    var out = empty_bounds();
    out.centre_px = centre;
    if half.y < 1e-3 {
        out.half_span_px = half.x;
    } else {
        out.per_half_height = 1.0 / (half.y + MARGIN_PX);
        out.shear = covariance / height2;
        out.half_span_px = sqrt(span2);
        let slant = out.shear * (half.y + MARGIN_PX);
        let length2 = slant * slant + span2;
        if length2 > 0.0 {
            out.rightmost_dy_px = slant * inverseSqrt(length2) * (half.y + MARGIN_PX);
        }
    }
    return with_box(out, Box(centre - half, centre + half));
}

// Box of the disc's bounding quad after clipping at the near plane.
fn clipped_bounds(p: vec3f, half_u: vec3f, half_v: vec3f) -> Bounds {
    let quad = array(p - half_u - half_v, p + half_u - half_v, p + half_u + half_v, p - half_u + half_v);
    var extent = Box(vec2f(1e30), vec2f(-1e30));
    for (var k = 0u; k < 4u; k += 1u) {
        let corner = quad[k];
        let next = quad[(k + 1u) % 4u];
        let inside = corner.z >= step.near;
        if inside {
            extent = including(extent, corner);
        }
        if inside != (next.z >= step.near) {
            let t = (step.near - corner.z) / (next.z - corner.z);
            extent = including(extent, vec3f(mix(corner.xy, next.xy, t), step.near));
        }
    }
    var out = empty_bounds();
    if extent.low.x > extent.high.x {
        return out;
    }
    // Wider than any image: spans are clipped to the box.
    out.half_span_px = 1e9;
    // Rounding of distant intersections: widen by a relative 1e-5.
    let slack = 1e-5 * (abs(extent.low) + abs(extent.high));
    return with_box(out, Box(extent.low - slack, extent.high + slack));
}

fn including(extent: Box, v: vec3f) -> Box {
    let px = step.focal_px * v.xy / v.z + step.principal_px;
    return Box(min(extent.low, px), max(extent.high, px));
}

// Half-open range of the tile columns that the splat touches in a row of tiles.
fn tile_run(bounds: Bounds, tile_row: i32) -> vec2i {
    let low = unpack_px(bounds.box_min);
    let high = unpack_px(bounds.box_max);
    let tile = i32(TILE_PX);
    let tile_rows = i32(TILE_ROWS_PX);
    let first_row = max(tile_row * tile_rows, low.y);
    let past_row = min((tile_row + 1) * tile_rows, high.y);
    let limit = vec2f(f32(low.x), f32(high.x));
    var run = vec2f(limit.y, limit.x);
    if high.y - low.y <= tile {
        // A small splat may miss all pixel centres: testing each row lists no tile without need.
        for (var row = first_row; row < past_row; row += 1) {
            let dy = f32(row) + 0.5 - bounds.centre_px.y;
            let span = span_px(bounds, dy, dy, limit);
            if span.x < span.y {
                run = vec2f(min(run.x, span.x), max(run.y, span.y));
            }
        }
    } else {
        // The right ends of the spans are concave in y and the left ends convex: the extremes lie at the
        // outermost points of the ellipse or at the edges of the tile.
        let first_dy = f32(first_row) + 0.5 - bounds.centre_px.y;
        let last_dy = f32(past_row) - 0.5 - bounds.centre_px.y;
        let right_dy = clamp(bounds.rightmost_dy_px, first_dy, last_dy);
        let left_dy = clamp(-bounds.rightmost_dy_px, first_dy, last_dy);
        run = span_px(bounds, left_dy, right_dy, limit);
    }
    if run.x >= run.y {
        return vec2i(0, 0);
    }
    return vec2i(i32(run.x) / tile, (i32(run.y) - 1) / tile + 1);
}

// Half-open range of pixels between the span's left end in one row and its right end in another.
fn span_px(bounds: Bounds, left_dy: f32, right_dy: f32, limit: vec2f) -> vec2f {
    let left = bounds.centre_px.x + bounds.shear * left_dy - half_span(bounds, left_dy);
    let right = bounds.centre_px.x + bounds.shear * right_dy + half_span(bounds, right_dy);
    return vec2f(
        clamp(ceil(left - 0.5 - MARGIN_PX), limit.x, limit.y),
        clamp(floor(right - 0.5 + MARGIN_PX) + 1.0, limit.x, limit.y),
    );
}

fn half_span(bounds: Bounds, dy_px: f32) -> f32 {
    let t = dy_px * bounds.per_half_height;
    return bounds.half_span_px * sqrt(max(1.0 - t * t, 0.0));
}

// Half-open range of the rows of tiles that the box touches.
fn tile_rows(bounds: Bounds) -> vec2i {
    let low = unpack_px(bounds.box_min);
    let high = unpack_px(bounds.box_max);
    if high.y <= low.y {
        return vec2i(0, 0);
    }
    return vec2i(low.y / i32(TILE_ROWS_PX), (high.y - 1) / i32(TILE_ROWS_PX) + 1);
}
