// Replaces the rendered image by what the photo's exposure shows, and sums from what that exposure is estimated (twin:
// reference/exposure.rs).
// Workgroup: a square tile. Invocation: a pixel, then a share of one sum.

#constants
#include common/step
#include common/photo
#include common/image
#include common/exposure

@group(0) @binding(1) var<storage, read> photo: array<u32>; // [pool], see common/photo
@group(0) @binding(2) var<storage, read_write> pixels: array<vec4f>; // [h, w] r, g, b, transmittance
@group(0) @binding(3) var<storage, read_write> exposure_partials: array<vec4f>; // [tiles, 6]

// Of each pixel 1, its rendered colour and its photo's; zeros if it does not count.
var<workgroup> values: array<array<f32, 7>, GROUP>;
var<workgroup> parts: array<f32, SUMS * PARTS>;

// Each sum is formed in this many parts.
const PARTS = 8u;

@compute @workgroup_size(GROUP)
fn exposure_fwd(
    @builtin(workgroup_id) wid: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lid: u32,
) {
    let tile = wid.x + wid.y * groups.x;
    let pixel = image_pixel(tile, vec2i(vec2u(lid % TILE_PX, lid / TILE_PX)));
    values[lid] = array<f32, 7>();
    if pixel != OUTSIDE {
        let texel = photo[step.photo_offset_px + pixel];
        let x = pixels[pixel];
        if photo_counts(texel) {
            let y = photo_colour(texel);
            values[lid] = array<f32, 7>(1.0, x.x, x.y, x.z, y.x, y.y, y.z);
        }
        let one = vec4f(x.xyz, 1.0);
        pixels[pixel] =
            vec4f(dot(step.exposure_row0, one), dot(step.exposure_row1, one), dot(step.exposure_row2, one), x.w);
    }
    workgroupBarrier();
    if lid < SUMS * PARTS {
        let factors = sum_factors(lid / PARTS);
        let first = lid % PARTS * (GROUP / PARTS);
        var sum = 0.0;
        for (var k = first; k < first + GROUP / PARTS; k += 1u) {
            sum += values[k][factors.x] * values[k][factors.y];
        }
        parts[lid] = sum;
    }
    workgroupBarrier();
    if lid < SUMS / 4u && tile < num_loss_tiles() {
        exposure_partials[tile * (SUMS / 4u) + lid] = vec4f(
            sum_of_parts(4u * lid),
            sum_of_parts(4u * lid + 1u),
            sum_of_parts(4u * lid + 2u),
            sum_of_parts(4u * lid + 3u),
        );
    }
}

fn sum_of_parts(sum: u32) -> f32 {
    var total = 0.0;
    for (var k = 0u; k < PARTS; k += 1u) {
        total += parts[sum * PARTS + k];
    }
    return total;
}

// The two values of a pixel whose product a sum is over, in the order of `ColourSums`; what is left over is zero.
fn sum_factors(sum: u32) -> vec2u {
    if sum < 4u {
        return vec2u(0u, sum);
    }
    if sum < 7u {
        return vec2u(1u, sum - 3u);
    }
    if sum < 9u {
        return vec2u(2u, sum - 5u);
    }
    if sum < 10u {
        return vec2u(3u, 3u);
    }
    if sum < 13u {
        return vec2u(0u, sum - 6u);
    }
    return vec2u(1u + min((sum - 13u) / 3u, 2u), 4u + (sum - 13u) % 3u);
}
