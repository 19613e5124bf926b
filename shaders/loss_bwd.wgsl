// Derivative of the image loss w.r.t. each pixel, from the SSIM maps of `loss_fwd`: the window is its own adjoint (twin:
// reference/loss.rs).
// Workgroup: a square tile. Invocation: a pixel.

#constants
#include common/step
#include common/photo
#include common/window

@group(0) @binding(1) var<storage, read> pixels: array<vec4f>; // [h, w] r, g, b, transmittance
@group(0) @binding(2) var<storage, read> photo: array<u32>; // [pool], see common/photo
@group(0) @binding(3) var<storage, read> ssim_maps: array<f32>; // [3 channels, 3, h, w]
@group(0) @binding(4) var<storage, read> loss_map: array<f32>; // [h, w]
@group(0) @binding(5) var<storage, read_write> pixel_grad: array<vec4f>; // [h, w] by r, g, b; loss_map

// The three maps of a channel, in two arrays because a vec3f occupies 16 bytes.
var<workgroup> halo_xy: array<vec2f, HALO>;
var<workgroup> halo_z: array<f32, HALO>;
var<workgroup> across: array<vec3f, ACROSS>; // blurred along x

@compute @workgroup_size(GROUP)
fn loss_bwd(
    @builtin(workgroup_id) wid: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lid: u32,
) {
    let tile = wid.x + wid.y * groups.x;
    let pixel0 = halo_pixel(tile, lid);
    let pixel1 = halo_pixel(tile, lid + GROUP);
    let pixel2 = halo_pixel(tile, lid + 2u * GROUP);
    let pixel = image_pixel(tile, vec2i(vec2u(lid % TILE_PX, lid / TILE_PX)));
    let here = sum_difference_at(pixel);
    var gradient = vec3f();
    for (var c = 0u; c < 3u; c += 1u) {
        // 2 * GROUP < HALO.
        load_maps(c, lid, pixel0);
        load_maps(c, lid + GROUP, pixel1);
        if lid + 2u * GROUP < HALO {
            load_maps(c, lid + 2u * GROUP, pixel2);
        }
        workgroupBarrier();
        if 2u * lid < ACROSS {
            let two = blurred_across(2u * lid);
            across[2u * lid] = two[0].xyz;
            across[2u * lid + 1u] = two[1].xyz;
        }
        workgroupBarrier();
        let slopes = blurred_down(lid);
        gradient[c] = slopes.x + here.sum[c] * slopes.y + here.difference[c] * slopes.z;
    }
    if pixel != OUTSIDE {
        let per = 1.0 / (3.0 * f32(step.size_px.x * step.size_px.y));
        let d = here.difference;
        gradient += per * (step.loss_l1 * sign(d) + 2.0 * step.loss_mse * d);
        // The pool holds a photo of the image's size from `photo_offset_px` on.
        let kept = photo_counts(photo[step.photo_offset_px + pixel]);
        pixel_grad[pixel] = vec4f(select(vec3f(), gradient, kept), loss_map[pixel]);
    }
}

// Copies the SSIM maps of a channel at one pixel into workgroup memory, to a place below HALO; zero outside the
// image, which has no windows.
fn load_maps(c: u32, place: u32, pixel: u32) {
    var maps = vec3f();
    if pixel != OUTSIDE {
        let num_pixels = step.size_px.x * step.size_px.y;
        let at = 3u * c * num_pixels + pixel;
        maps = vec3f(ssim_maps[at], ssim_maps[at + num_pixels], ssim_maps[at + 2u * num_pixels]);
    }
    halo_xy[place] = maps.xy;
    halo_z[place] = maps.z;
}

fn tap(at: u32) -> vec4f {
    return vec4f(halo_xy[at], halo_z[at], 0.0);
}

fn row(i: u32, k: u32) -> vec4f {
    return vec4f(across[i + k * TILE_PX], 0.0);
}
