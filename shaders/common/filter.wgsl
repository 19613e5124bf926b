// The low-pass filter in the image (twin: `spread` in reference/project.rs; method 2.5).

// Lower Cholesky factor of the covariance of the filtered falloff, in standard deviations along u and v: those are
// (u_a x, v_a x + v_b y) at the filtered coordinates (x, y), in which the falloff is round.
struct Spread {
    u_a: f32,
    v_a: f32,
    v_b: f32,
}

// From the map from pixels to standard deviations at the projected centre, by rows, and its determinant, which would lose
// digits if computed from them where the splat is seen edge-on.
fn splat_spread(a: vec2f, b: vec2f, determinant: f32) -> Spread {
    let along_a = step.filter_px2 * dot(a, a);
    let area = step.filter_px2 * determinant;
    let squared = 1.0 + along_a + step.filter_px2 * dot(b, b) + area * area;
    let u_a = sqrt(1.0 + along_a);
    return Spread(u_a, step.filter_px2 * dot(a, b) / u_a, sqrt(squared) / u_a);
}

// That determinant.
fn map_determinant(per_px: vec2f, scales: vec2f, depth: f32) -> f32 {
    return per_px.x / scales.x * (depth / (step.focal_px.y * scales.y)) * depth;
}

// How much of the opacity is left: the filter thins what it widens.
fn thinning(spread: Spread) -> f32 {
    return 1.0 / (spread.u_a * spread.v_b);
}

// Footprint of a pixel on the texture map, from the map from pixels to filtered coordinates and the texels per coordinate.
fn map_footprint(a: vec2f, b: vec2f, texels: vec3f) -> vec2f {
    let along_u = texels.x * a;
    let along_v = texels.y * a + texels.z * b;
    let squared = 2.0 * vec2f(dot(along_u, along_u), dot(along_v, along_v)) - 1.0;
    let footprint = min(sqrt(max(squared, vec2f(1.0))), vec2f(FOOTPRINT_TEXELS_MAX));
    return select(vec2f(1.0), footprint, step.filter_px2 > 0.0);
}
