// Blurs image and photo with the 11-tap window of SSIM, for a workgroup per tile (twin: `blur` in
// reference/loss.rs). The window is applied to sum and difference of image and photo, so that nothing cancels
// where they agree. Requires `pixels` and `photo` bound, and the functions `tap` and `row`.

#include common/image

// The halo is the tile with the window's radius around it: its edge, and its pixels.
const HALO_PX = TILE_PX + 2u * SSIM_RADIUS_PX;
const HALO = HALO_PX * HALO_PX;
// Pixels of the halo in the columns of the tile.
const ACROSS = HALO_PX * TILE_PX;

// Image x and photo y at one pixel.
struct SumDifference {
    // x + y
    sum: vec3f,
    // x - y
    difference: vec3f,
}

// Index of the pixel at a position in the halo.
fn halo_pixel(tile: u32, place: u32) -> u32 {
    let offset = vec2i(vec2u(place % HALO_PX, place / HALO_PX)) - i32(SSIM_RADIUS_PX);
    return select(OUTSIDE, image_pixel(tile, offset), place < HALO);
}

// Masked pixels count as equal to the photo, pixels outside the image as black in both.
fn sum_difference_at(pixel: u32) -> SumDifference {
    if pixel == OUTSIDE {
        return SumDifference(vec3f(), vec3f());
    }
    let texel = photo[step.photo_offset_px + pixel];
    let y = photo_colour(texel);
    let difference = select(vec3f(), pixels[pixel].xyz - y, photo_counts(texel));
    return SumDifference(difference + 2.0 * y, difference);
}

// Unrolled by hand: a loop would index the array of weights at run time.
fn window(
    a: vec4f, b: vec4f, c: vec4f, d: vec4f, e: vec4f, middle: vec4f,
    e1: vec4f, d1: vec4f, c1: vec4f, b1: vec4f, a1: vec4f,
) -> vec4f {
    return SSIM_WINDOW[0] * (a + a1) + SSIM_WINDOW[1] * (b + b1) + SSIM_WINDOW[2] * (c + c1)
        + SSIM_WINDOW[3] * (d + d1) + SSIM_WINDOW[4] * (e + e1) + SSIM_WINDOW[5] * middle;
}

// Blurs two neighbours of a row at once, since they share most of their windows. `tap` reads a position in the halo: i is even and
// below ACROSS, so that the last one is HALO - 1 at most.
fn blurred_across(i: u32) -> mat2x4f {
    let at = i / TILE_PX * HALO_PX + i % TILE_PX;
    let a = tap(at);
    let b = tap(at + 1u);
    let c = tap(at + 2u);
    let d = tap(at + 3u);
    let e = tap(at + 4u);
    let f = tap(at + 5u);
    let g = tap(at + 6u);
    let h = tap(at + 7u);
    let k = tap(at + 8u);
    let l = tap(at + 9u);
    let m = tap(at + 10u);
    let n = tap(at + 11u);
    return mat2x4f(window(a, b, c, d, e, f, g, h, k, l, m), window(b, c, d, e, f, g, h, k, l, m, n));
}

// Blurs along the column. `row` reads the result of `blurred_across`, k rows below: i lies below GROUP, and ACROSS has
// 2 * SSIM_RADIUS_PX rows more.
fn blurred_down(i: u32) -> vec4f {
    return window(
        row(i, 0u), row(i, 1u), row(i, 2u), row(i, 3u), row(i, 4u), row(i, 5u),
        row(i, 6u), row(i, 7u), row(i, 8u), row(i, 9u), row(i, 10u),
    );
}
