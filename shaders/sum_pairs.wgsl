// Sums the partial sums of each visible splat's pairs in a fixed order (no twin: part of what `project_bwd` computes).
// Workgroup: GROUP sums. Invocation: one sum of a splat.

#constants
#include common/groups
#include common/step
#include common/bounds
#include common/projected

@group(0) @binding(1) var<storage, read> bounds: array<Bounds>; // [n]
@group(0) @binding(2) var<storage, read> partials: array<f32>; // [K, partial_stride] by slot
@group(0) @binding(3) var<storage, read_write> splat_totals: array<f32>; // [visible, partial_stride]
@group(0) @binding(4) var<storage, read> visible: array<u32>; // [1 + n] number of visible splats, then these, ascending

// Slots that are added up side by side, so that their reads do not wait for each other.
const PARTS = 4u;

@compute @workgroup_size(GROUP)
fn sum_pairs(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group_index(group, groups) * GROUP + lane;
    let stride = step.partial_stride;
    if index / stride >= visible[0] {
        return;
    }
    let i = visible[1u + index / stride];
    let count = bounds[i].num_tiles;
    var at = bounds[i].first_slot * stride + index % stride;
    var parts = vec4f(0.0);
    for (var left = count / PARTS; left > 0u; left -= 1u) {
        parts += vec4f(
            partials[at],
            partials[at + stride],
            partials[at + 2u * stride],
            partials[at + 3u * stride],
        );
        at += PARTS * stride;
    }
    for (var part = 0u; part < count % PARTS; part += 1u) {
        parts[part] += partials[at];
        at += stride;
    }
    splat_totals[index] = (parts.x + parts.y) + (parts.z + parts.w);
}
