// Flushes the texels of every visible splat and activates them (twin: adam_skipped in reference/adam.rs). Without
// FLAG_PERSIST (images) the flushed parameters are not stored, only activated. FLAG_ALL_MAPS: all splats, visible or
// not, and also maps that have nothing to flush.
// Workgroup: a visible splat, with FLAG_ALL_MAPS any. Invocation: every SPLAT_GROUP-th float of its map.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/splat
#include common/adam

@group(0) @binding(1) var<storage, read_write> texel_p: array<f32>; // [T, 3]
@group(0) @binding(2) var<storage, read_write> texel_m: array<f32>; // [T, 3]
@group(0) @binding(3) var<storage, read_write> texel_v: array<f32>; // [T, 3]
@group(0) @binding(4) var<storage, read_write> texel_values: array<f32>; // [T, 4] residual rgb
@group(0) @binding(5) var<storage, read_write> splat_info: array<SplatInfo>; // [n]
@group(0) @binding(6) var<storage, read> visible: array<u32>; // [1 + n] number of visible splats, then these, ascending

@compute @workgroup_size(SPLAT_GROUP)
fn flush_texel(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let all = has_flag(FLAG_ALL_MAPS);
    let place = group_index(group, groups);
    if place >= select(visible[0], step.num_splats, all) {
        return;
    }
    var i = place;
    if !all {
        i = visible[1u + place];
    }
    let info = splat_info[i];
    let skip = adam_skip(info.last_step, step.flushed_step);
    if skip.any || all {
        let first = 3u * info.map_offset_texels;
        let texels = num_texels(info.map_size);
        let growth = step.last_rate_texel_growth;
        let rate = map_rate(step.last_rate_texel, growth, step.last_rate_texel_growth_limit, texels);
        for (var f = lane; f < 3u * texels; f += SPLAT_GROUP) {
            let at = first + f;
            var now = Moments(texel_p[at], texel_m[at], texel_v[at]);
            if skip.any {
                now = adam_skipped(now, skip, rate);
                if has_flag(FLAG_PERSIST) {
                    texel_p[at] = now.p;
                    texel_m[at] = now.m;
                    texel_v[at] = now.v;
                }
            }
            texel_values[4u * (at / 3u) + at % 3u] = texel_value(now.p);
        }
    }
    storageBarrier();
    if lane == 0u && skip.any && has_flag(FLAG_PERSIST) {
        splat_info[i].last_step = step.flushed_step;
    }
}
