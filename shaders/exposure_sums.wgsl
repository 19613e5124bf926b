// Sums the partial sums of the tiles into the status of the step; in a fixed order (no twin).
// One workgroup. Invocation: every GROUP-th tile.

#constants
#include common/step
#include common/exposure
#include common/status

@group(0) @binding(1) var<storage, read> exposure_partials: array<vec4f>; // [tiles, 6]
@group(0) @binding(2) var<storage, read_write> status: array<Status>;

var<workgroup> totals: array<vec4f, GROUP>;

@compute @workgroup_size(GROUP)
fn exposure_sums(@builtin(local_invocation_index) lane: u32) {
    let num_tiles = num_loss_tiles();
    for (var k = 0u; k < SUMS / 4u; k += 1u) {
        var total = vec4f();
        for (var tile = lane; tile < num_tiles; tile += GROUP) {
            total += exposure_partials[tile * (SUMS / 4u) + k];
        }
        totals[lane] = total;
        workgroupBarrier();
        for (var half = GROUP / 2u; half > 0u; half /= 2u) {
            if lane < half {
                totals[lane] += totals[lane + half];
            }
            workgroupBarrier();
        }
        if lane == 0u {
            status[step.status_slot].colour_sums[k] = totals[0];
        }
        workgroupBarrier();
    }
}
