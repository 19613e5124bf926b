// L1, SSIM and squared difference of image and photo, and the derivatives of SSIM w.r.t. the means under each window,
// which `loss_bwd` reads (twin: reference/loss.rs).
// Workgroup: a square tile. Invocation: a pixel.

#constants
#include common/step
#include common/photo
#include common/window

@group(0) @binding(1) var<storage, read> pixels: array<vec4f>; // [h, w] r, g, b, transmittance
@group(0) @binding(2) var<storage, read> photo: array<u32>; // [pool], see common/photo
@group(0) @binding(3) var<storage, read_write> ssim_maps: array<f32>; // [3 channels, 3, h, w]
@group(0) @binding(4) var<storage, read_write> loss_map: array<f32>; // [h, w] l1 and dssim terms
@group(0) @binding(5) var<storage, read_write> loss_partials: array<vec4f>; // [tiles] |d|, 1 - SSIM, d^2

var<workgroup> halo: array<vec2f, HALO>; // sum and difference of a channel
var<workgroup> across: array<vec4f, ACROSS>; // blurred along x: sum, difference, their squares

struct Similarity {
    // 1 - SSIM
    loss: f32,
    // With s and d the sum and difference of image and photo at a pixel under the window, the derivative of
    // SSIM by that pixel is the window's weight times slopes.x + slopes.y s + slopes.z d.
    slopes: vec3f,
}

@compute @workgroup_size(GROUP)
fn loss_fwd(
    @builtin(workgroup_id) wid: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lid: u32,
) {
    let tile = wid.x + wid.y * groups.x;
    let values0 = sum_difference_at(halo_pixel(tile, lid));
    let values1 = sum_difference_at(halo_pixel(tile, lid + GROUP));
    let values2 = sum_difference_at(halo_pixel(tile, lid + 2u * GROUP));
    let x = lid % TILE_PX;
    let y = lid / TILE_PX;
    let pixel = image_pixel(tile, vec2i(vec2u(x, y)));
    let num_pixels = step.size_px.x * step.size_px.y;
    let scale = -step.loss_dssim / (3.0 * f32(num_pixels));
    var sums = vec3f();
    for (var c = 0u; c < 3u; c += 1u) {
        // 2 * GROUP < HALO, and the tile lies SSIM_RADIUS_PX within the halo.
        halo[lid] = vec2f(values0.sum[c], values0.difference[c]);
        halo[lid + GROUP] = vec2f(values1.sum[c], values1.difference[c]);
        if lid + 2u * GROUP < HALO {
            halo[lid + 2u * GROUP] = vec2f(values2.sum[c], values2.difference[c]);
        }
        workgroupBarrier();
        let d = halo[(y + SSIM_RADIUS_PX) * HALO_PX + x + SSIM_RADIUS_PX].y;
        if 2u * lid < ACROSS {
            let two = blurred_across(2u * lid);
            across[2u * lid] = two[0];
            across[2u * lid + 1u] = two[1];
        }
        workgroupBarrier();
        if pixel != OUTSIDE {
            let here = similarity(blurred_down(lid));
            let at = 3u * c * num_pixels + pixel;
            // c is below 3, and `pixel` one of the image, here and below.
            ssim_maps[at] = scale * here.slopes.x;
            ssim_maps[at + num_pixels] = scale * here.slopes.y;
            ssim_maps[at + 2u * num_pixels] = scale * here.slopes.z;
            sums += vec3f(abs(d), here.loss, d * d);
        }
    }
    if pixel != OUTSIDE {
        loss_map[pixel] = (step.loss_l1 * sums.x + step.loss_dssim * sums.y) / 3.0;
    }
    // Each row, then the sums of the rows: a fixed order, whatever the schedule.
    workgroupBarrier();
    // GROUP + TILE_PX <= ACROSS.
    across[lid] = vec4f(sums, 0.0);
    workgroupBarrier();
    if lid < TILE_PX {
        across[GROUP + lid] = row_sum(lid * TILE_PX);
    }
    workgroupBarrier();
    if lid == 0u && tile < num_loss_tiles() {
        loss_partials[tile] = row_sum(GROUP);
    }
}

fn row_sum(first: u32) -> vec4f {
    var sum = vec4f();
    for (var k = 0u; k < TILE_PX; k += 1u) {
        sum += across[first + k];
    }
    return sum;
}

fn tap(at: u32) -> vec4f {
    let value = halo[at];
    return vec4f(value, value * value);
}

fn row(i: u32, k: u32) -> vec4f {
    return across[i + k * TILE_PX];
}

// SSIM from the means of u, v, u^2 and v^2 with u = x + y and v = x - y: 2 mx my = (mu^2 - mv^2) / 2 and 2 cov
// = (var u - var v) / 2, with plus signs in the denominators. Every term of 1 - SSIM then has mv^2 or var v as
// a factor, so that nothing cancels where image and photo agree.
fn similarity(mean: vec4f) -> Similarity {
    let u = mean.x;
    let v = mean.y;
    // Rounding may make a variance negative.
    let variance = max(mean.zw - mean.xy * mean.xy, vec2f(0.0));
    let a1 = 0.5 * (u * u - v * v) + SSIM_C1;
    let b1 = 0.5 * (u * u + v * v) + SSIM_C1;
    let a2 = 0.5 * (variance.x - variance.y) + SSIM_C2;
    let b2 = 0.5 * (variance.x + variance.y) + SSIM_C2;
    let per = 1.0 / (b1 * b2);
    let by_squares = a1 * per / b2 * vec2f(variance.y, -variance.x - 2.0 * SSIM_C2);
    let by_mean = a2 * per / b1 * v * (u * v - u * u - 2.0 * SSIM_C1) - dot(mean.xy, by_squares);
    return Similarity((b1 * variance.y + a2 * v * v) * per, vec3f(by_mean, by_squares));
}
