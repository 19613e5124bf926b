// Sums the partial sums of each visible splat's pairs, in the order of its slots (no twin: part of what `project_bwd`
// computes). Adds those of `partial_capacity` pairs from `partial_first` on: as a splat's pairs have the same order by slot and by
// place, the sums do not depend on how many are added at a time.
// Workgroup: GROUP sums. Invocation: one sum of a splat.

#constants
#include common/groups
#include common/step
#include common/bounds
#include common/projected

@group(0) @binding(1) var<storage, read> bounds: array<Bounds>; // [n]
@group(0) @binding(2) var<storage, read> partials: array<f32>; // [partial_capacity, partial_stride]
@group(0) @binding(3) var<storage, read_write> splat_totals: array<f32>; // [visible, partial_stride]
@group(0) @binding(4) var<storage, read> visible: array<u32>; // [1 + n] number of visible splats, then these, ascending
@group(0) @binding(5) var<storage, read> slots: array<u32>; // [num_pairs] places of the pairs

// A sum of the pair at a slot; 0 if it is not among those added.
fn sum_at(slot: u32, sum: u32) -> f32 {
    // Wraps around before partial_first. partial_capacity is at least 1.
    let place = slots[slot] - step.partial_first;
    let value = partials[min(place, step.partial_capacity - 1u) * step.partial_stride + sum];
    return select(0.0, value, place < step.partial_capacity);
}

@compute @workgroup_size(GROUP)
fn sum_pairs(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group_index(group, groups) * GROUP + lane;
    if index / step.partial_stride >= visible[0] {
        return;
    }
    let i = visible[1u + index / step.partial_stride];
    let sum = index % step.partial_stride;
    var slot = bounds[i].first_slot;
    // At most needed_pairs: the splats' slots are contiguous.
    let past = slot + bounds[i].num_tiles;
    var total = 0.0;
    if step.partial_first > 0u {
        total = splat_totals[index];
    }
    // Four at a time, so that their reads do not wait for each other.
    for (; slot + 4u <= past; slot += 4u) {
        let four = vec4f(sum_at(slot, sum), sum_at(slot + 1u, sum), sum_at(slot + 2u, sum), sum_at(slot + 3u, sum));
        total = (((total + four.x) + four.y) + four.z) + four.w;
    }
    for (; slot < past; slot += 1u) {
        total += sum_at(slot, sum);
    }
    splat_totals[index] = total;
}
