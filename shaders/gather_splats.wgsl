// Applies a density-control plan to one array of splat parameters or moments: copies the entries of each new splat
// from its source, except for coefficients above its SH degree, which are 0 (twins: SplatArrays::gathered, set_sh_degrees).
// Workgroup: a new splat. Invocation: a float of its parameters.

#constants
#include common/groups
#include common/step
#include common/splat

@group(0) @binding(1) var<storage, read> sources: array<u32>; // [n_new]
@group(0) @binding(2) var<storage, read> old_values: array<f32>; // [n_old, stride]
@group(0) @binding(3) var<storage, read_write> new_values: array<f32>; // [n_new, stride]
@group(0) @binding(4) var<storage, read> splat_info: array<SplatInfo>; // [n_new]

@compute @workgroup_size(SPLAT_GROUP)
fn gather_splats(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups);
    if i < step.num_splats && lane < step.splat_stride {
        let value = old_values[sources[i] * step.splat_stride + lane];
        let held = SH + 3u * sh_coefficients(splat_info[i].sh_degree);
        new_values[i * step.splat_stride + lane] = select(0.0, value, lane < held);
    }
}
