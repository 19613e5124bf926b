// Flushes the SH of every splat, visible or not: before density control, and before the model is read for display
// (twin: adam_skipped in reference/adam.rs). flush_texel, which runs after this, updates the splats' last step.
// Workgroup: a splat. Invocation: a float of its SH.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/splat
#include common/adam

@group(0) @binding(1) var<storage, read_write> splat_p: array<f32>; // [num_splat_floats]
@group(0) @binding(2) var<storage, read_write> splat_m: array<f32>; // [num_splat_floats]
@group(0) @binding(3) var<storage, read_write> splat_v: array<f32>; // [num_splat_floats]
@group(0) @binding(4) var<storage, read> splat_info: array<SplatInfo>; // [n]

@compute @workgroup_size(SPLAT_GROUP)
fn flush_splat(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups);
    let f = SH + lane;
    if i >= step.num_splats {
        return;
    }
    let info = splat_info[i];
    let skip = adam_skip(info.last_step, step.flushed_step);
    if skip.any && f < num_floats(info.parameters) {
        let at = first_float(info.parameters) + f;
        let rate = select(step.last_rate_sh_rest, step.last_rate_sh_dc, lane < 3u);
        let now = adam_skipped(Moments(splat_p[at], splat_m[at], splat_v[at]), skip, rate);
        splat_p[at] = now.p;
        splat_m[at] = now.m;
        splat_v[at] = now.v;
    }
}
