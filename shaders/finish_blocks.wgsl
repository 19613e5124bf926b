// Sums opacity and texture terms and faults over each block of GROUP visible splats, in a fixed order;
// `finish` sums the blocks (no twin).
// Workgroup: a block of visible splats. Invocation: a visible splat.

#constants
#include common/groups
#include common/step
#include common/projected
#include common/bounds
#include common/splat_sums

@group(0) @binding(1) var<storage, read> bounds: array<Bounds>; // [n]
@group(0) @binding(2) var<storage, read_write> splat_sums: array<SplatSums>; // [visible / GROUP]
@group(0) @binding(3) var<storage, read> visible: array<u32>; // [1 + n] number of visible splats, then these, ascending

var<workgroup> sums: array<vec2f, GROUP>;
var<workgroup> faults: array<u32, GROUP>;

@compute @workgroup_size(GROUP)
fn finish_blocks(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_index(group, groups);
    if block * GROUP >= visible[0] {
        return;
    }
    let place = block * GROUP + lane;
    var sum = vec2f(0.0);
    var own_faults = 0u;
    if place < visible[0] {
        let i = visible[1u + place];
        sum = vec2f(step.opacity_weight * bounds[i].opacity, step.texture_weight * bounds[i].texture_sum);
        own_faults = bounds[i].faults;
    }
    sums[lane] = sum;
    faults[lane] = own_faults;
    workgroupBarrier();
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        if lane < half {
            sums[lane] += sums[lane + half];
            faults[lane] += faults[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        splat_sums[block] = SplatSums(sums[0].x, sums[0].y, faults[0]);
    }
}
