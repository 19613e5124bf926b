// Replaces the derivative w.r.t. the image as the photo's exposure shows it by that w.r.t. the rendered one (twin:
// reference/exposure.rs).
// Workgroup: a tile of 16 x 16 pixels. Invocation: a pixel.

#constants
#include common/step
#include common/image

@group(0) @binding(1) var<storage, read_write> pixel_grad: array<vec4f>; // [h, w] by r, g, b; loss

@compute @workgroup_size(GROUP)
fn exposure_bwd(
    @builtin(workgroup_id) wid: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lid: u32,
) {
    let tile = wid.x + wid.y * groups.x;
    let pixel = image_pixel(tile, vec2i(vec2u(lid % TILE_PX, lid / TILE_PX)));
    if pixel != OUTSIDE {
        let g = pixel_grad[pixel];
        let back = step.exposure_row0.xyz * g.x + step.exposure_row1.xyz * g.y + step.exposure_row2.xyz * g.z;
        pixel_grad[pixel] = vec4f(back, g.w);
    }
}
