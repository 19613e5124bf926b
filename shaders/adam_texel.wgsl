// One step of Adam on the texels of every visible splat, with the texture term and the slope of the activation (twin:
// reference/adam.rs). Also activates the new texels, resets the gradients to zero, and stores the sum of the absolute
// residuals before the step.
// Workgroup: a visible splat. Invocation: every SPLAT_GROUP-th float of its map.

#constants
#include common/groups
#include common/numbers
#include common/step
#include common/splat
#include common/projected
#include common/bounds
#include common/fixed
#include common/adam

@group(0) @binding(1) var<storage, read_write> texel_p: array<f32>; // [T, 3]
@group(0) @binding(2) var<storage, read_write> texel_m: array<f32>; // [T, 3]
@group(0) @binding(3) var<storage, read_write> texel_v: array<f32>; // [T, 3]
@group(0) @binding(4) var<storage, read_write> texel_grad: array<i32>; // [T, 3] fixed point
@group(0) @binding(5) var<storage, read_write> texel_values: array<f32>; // [T, 4] residual rgb
@group(0) @binding(6) var<storage, read_write> splat_info: array<SplatInfo>; // [n]
@group(0) @binding(7) var<storage, read_write> bounds: array<Bounds>; // [n]
@group(0) @binding(8) var<storage, read> visible: array<u32>; // [1 + n] number of visible splats, then these, ascending

var<workgroup> residuals: array<f32, SPLAT_GROUP>;

// Returns the absolute residual before the step.
fn update(at: u32, units: f32, rate: f32) -> f32 {
    // The value that the forward pass used: recomputing it is cheaper than reading it.
    let parameter = texel_p[at];
    let value = texel_value(parameter);
    // The texture term has no gradient at exactly 0.
    let by_value = f32(texel_grad[at]) / units + step.texture_weight * sign(value);
    texel_grad[at] = 0;
    let by = by_value * texel_value_slope(value);
    let now = adam_step(Moments(parameter, texel_m[at], texel_v[at]), by, rate);
    texel_p[at] = now.p;
    texel_m[at] = now.m;
    texel_v[at] = now.v;
    texel_values[4u * (at / 3u) + at % 3u] = texel_value(now.p);
    return abs(value);
}

@compute @workgroup_size(SPLAT_GROUP)
fn adam_texel(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let place = group_index(group, groups);
    if place >= visible[0] {
        return;
    }
    let i = visible[1u + place];
    let footprint = bounds[i];
    let info = splat_info[i];
    let texels = num_texels(info.map_size);
    let rate = map_rate(step.rate_texel, step.rate_texel_growth, step.rate_texel_growth_limit, texels);
    let units = texel_units(footprint.box_min, footprint.box_max);
    var residual_sum = 0.0;
    for (var f = lane; f < 3u * texels; f += SPLAT_GROUP) {
        residual_sum += update(3u * info.map_offset_texels + f, units, rate);
    }
    residuals[lane] = residual_sum;
    workgroupBarrier();
    for (var half = SPLAT_GROUP / 2u; half > 0u; half /= 2u) {
        if lane < half {
            residuals[lane] += residuals[lane + half];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        bounds[i].texture_sum = residuals[0];
        splat_info[i].last_step = step.step;
    }
}
