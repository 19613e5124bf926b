// Applies the edits of a density-control plan, after gather_splats: writes the new parameters of a splat and zeroes
// the first moments of all its parameters (twin: cpu/apply_plan.rs).
// Workgroup: an edit. Invocation: a float of the splat's parameters.

#constants
#include common/groups
#include common/step
#include common/splat

// Mirrors `layout::Edit`.
struct Edit {
    position: vec3f,
    opacity_logit: f32,
    log_scales: vec2f,
    splat: u32,
    pad: u32,
}

@group(0) @binding(1) var<storage, read> edits: array<Edit>; // [num_edits]
@group(0) @binding(2) var<storage, read_write> splat_p: array<f32>; // [num_new_floats]
@group(0) @binding(3) var<storage, read_write> splat_m: array<f32>; // [num_new_floats]
@group(0) @binding(4) var<storage, read> splat_info: array<SplatInfo>; // [n_new]

@compute @workgroup_size(SPLAT_GROUP)
fn edit_splats(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    // Dispatched with one workgroup per splat; a plan has at most as many edits.
    let e = group_index(group, groups);
    if e >= arrayLength(&edits) {
        return;
    }
    let edit = edits[e];
    let parameters = splat_info[edit.splat].parameters;
    if lane >= num_floats(parameters) {
        return;
    }
    let first = first_float(parameters);
    splat_m[first + lane] = 0.0;
    if lane < 3u {
        splat_p[first + POSITION + lane] = edit.position[lane];
    }
    if lane < 2u {
        splat_p[first + LOG_SCALE + lane] = edit.log_scales[lane];
    }
    if lane == 0u {
        splat_p[first + OPACITY] = edit.opacity_logit;
    }
}
