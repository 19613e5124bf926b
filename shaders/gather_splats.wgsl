// Applies a density-control plan to one array of splat parameters or moments: copies the entries of each new splat
// from its source, without coefficients above its SH degree. Those that the source lacks are 0; with FLAG_SECOND_MOMENTS,
// those of DC in the same channel (twins: SplatArrays::gathered, gathered_second_moments).
// Workgroup: a new splat. Invocation: a float of its parameters.

#constants
#include common/groups
#include common/step
#include common/splat

@group(0) @binding(1) var<storage, read> sources: array<u32>; // [n_new]
@group(0) @binding(2) var<storage, read> old_values: array<f32>; // [num_old_floats]
@group(0) @binding(3) var<storage, read_write> new_values: array<f32>; // [num_new_floats]
@group(0) @binding(4) var<storage, read> splat_info: array<SplatInfo>; // [n_new]
@group(0) @binding(5) var<storage, read> old_info: array<SplatInfo>; // [n_old]

@compute @workgroup_size(SPLAT_GROUP)
fn gather_splats(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups);
    if i >= step.num_splats {
        return;
    }
    let new_parameters = splat_info[i].parameters;
    let old_parameters = old_info[sources[i]].parameters;
    if lane < num_floats(new_parameters) {
        let is_held = lane < num_floats(old_parameters);
        let held = select(SH + (lane - SH) % 3u, lane, is_held);
        let value = old_values[first_float(old_parameters) + held];
        new_values[first_float(new_parameters) + lane] = select(0.0, value, is_held || has_flag(FLAG_SECOND_MOMENTS));
    }
}
