// Sums the loss terms and faults of a step into its status, which the host reads; in a fixed order (no twin).
// One workgroup. Invocation: every GROUP-th tile and every GROUP-th block of splats.

#constants
#include common/step
#include common/splat_sums
#include common/status

@group(0) @binding(1) var<storage, read> splat_sums: array<SplatSums>; // [visible / GROUP]
@group(0) @binding(2) var<storage, read> loss_partials: array<vec4f>; // [tiles] |d|, 1 - ssim, d^2
@group(0) @binding(3) var<storage, read_write> status: array<Status>;
#if GEOMETRY
@group(0) @binding(4) var<storage, read> geometry_partials: array<vec2f>; // [tiles] distortion, normal

var<workgroup> geometries: array<vec2f, GROUP>;
#endif

var<workgroup> losses: array<vec4f, GROUP>; // l1, dssim, mse, opacity
var<workgroup> textures: array<f32, GROUP>;
var<workgroup> faults: array<u32, GROUP>;

@compute @workgroup_size(GROUP)
fn finish(@builtin(local_invocation_index) lane: u32) {
    var loss = vec4f(0.0);
    for (var tile = lane; tile < num_loss_tiles(); tile += GROUP) {
        loss += vec4f(loss_partials[tile].xyz, 0.0);
    }
    var texture_sum = 0.0;
    var own_faults = 0u;
    for (var block = lane; block < (status[step.status_slot].visible + GROUP - 1u) / GROUP; block += GROUP) {
        let sums = splat_sums[block];
        loss.w += sums.opacity;
        texture_sum += sums.texture;
        own_faults += sums.faults;
    }
#if GEOMETRY
    var geometry = vec2f(0.0);
    for (var tile = lane; tile < step.grid.x * step.grid.y; tile += GROUP) {
        geometry += geometry_partials[tile];
    }
    geometries[lane] = geometry;
#endif
    losses[lane] = loss;
    textures[lane] = texture_sum;
    faults[lane] = own_faults;
    workgroupBarrier();
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        if lane < half {
            losses[lane] += losses[lane + half];
            textures[lane] += textures[lane + half];
            faults[lane] += faults[lane + half];
#if GEOMETRY
            geometries[lane] += geometries[lane + half];
#endif
        }
        workgroupBarrier();
    }
    if lane == 0u {
        let slot = step.status_slot;
        let count = 3.0 * f32(step.size_px.x * step.size_px.y);
        status[slot].l1 = step.loss_l1 * losses[0].x / count;
        status[slot].dssim = step.loss_dssim * losses[0].y / count;
        status[slot].mse = step.loss_mse * losses[0].z / count;
        status[slot].opacity = losses[0].w;
        status[slot].texture = textures[0];
#if GEOMETRY
        status[slot].distortion = step.loss_distortion * geometries[0].x * 3.0 / count;
        status[slot].normal = step.loss_normal * geometries[0].y * 3.0 / count;
#endif
        let counts_atomics = has_flag(FLAG_COUNT_ATOMICS);
        status[slot].faults = select(faults[0], 0u, counts_atomics);
        status[slot].texel_atomics = select(0u, faults[0], counts_atomics);
        status[slot].done = 1u;
    }
}
