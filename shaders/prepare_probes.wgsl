// The model as it is probed: no splat so opaque that its alpha would be clamped, no texel saturated; first moments and last
// steps are 0 (twin: `probed` in src/backend/probe.rs). All parameters must have been flushed.
// Workgroup: a splat. Invocation: every SPLAT_GROUP-th float of its parameters and of its map.

#constants
#include common/groups
#include common/step
#include common/splat

@group(0) @binding(1) var<storage, read_write> splat_p: array<f32>; // [num_splat_floats]
@group(0) @binding(2) var<storage, read_write> splat_m: array<f32>; // [num_splat_floats]
@group(0) @binding(3) var<storage, read_write> texel_p: array<f32>; // [T, 3]
@group(0) @binding(4) var<storage, read_write> texel_m: array<f32>; // [T, 3]
@group(0) @binding(5) var<storage, read_write> splat_info: array<SplatInfo>; // [n]

@compute @workgroup_size(SPLAT_GROUP)
fn prepare_probes(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_index(group, groups);
    if i >= step.num_splats {
        return;
    }
    let info = splat_info[i];
    let first = first_float(info.parameters);
    for (var f = lane; f < num_floats(info.parameters); f += SPLAT_GROUP) {
        splat_m[first + f] = 0.0;
        if f == OPACITY {
            splat_p[first + f] = min(splat_p[first + f], PROBED_LOGIT_MAX);
        }
    }
    for (var f = lane; f < 3u * num_texels(info.map_size); f += SPLAT_GROUP) {
        let at = 3u * info.map_offset_texels + f;
        texel_m[at] = 0.0;
        texel_p[at] = clamp(texel_p[at], -PROBED_TEXEL_MAX, PROBED_TEXEL_MAX);
    }
    storageBarrier();
    if lane == 0u {
        splat_info[i].last_step = 0u;
    }
}
