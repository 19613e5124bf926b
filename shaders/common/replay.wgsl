// A pixel on its way back to front, and the derivatives of one of its samples (twin: reference/raster_bwd.rs; method 2.4).
// Requires the bindings of raster_bwd.

struct Replay {
    transmittance: f32,
    // Sum of weight times the derivative with respect to weight, over the samples behind.
    behind: f32,
    // One past the last pair that was blended.
    end: u32,
    by_rgb: vec3f,
    // Texel gradients that were not finite or did not fit.
    faults: u32,
#if GEOMETRY
    // The derivative w.r.t. a sample's weight is constant + linear m + square m^2 + towards . normal, with m the
    // near depth over the sample's depth.
    by_moments: vec3f,
    towards: vec3f,
#endif
}

// A pixel of a tile whose pairs begin at `first`. Outside the image, nothing was blended.
fn replay_at(pixel: vec2u, first: u32) -> Replay {
    var replay = Replay();
    replay.transmittance = 1.0;
    replay.end = first;
    if all(pixel < step.size_px) {
        let at = pixel.y * step.size_px.x + pixel.x;
#if GEOMETRY
        replay.by_rgb = pixel_records[3u * at].xyz;
        let c = pixel_records[3u * at + 1u];
        let towards = pixel_records[3u * at + 2u];
        replay.transmittance = c.w;
        replay.by_moments = c.xyz;
        replay.towards = towards.xyz;
        replay.end = first + u32(towards.w);
#else
        let state = pixel_state[at];
        replay.by_rgb = pixel_grad[at].xyz;
        replay.transmittance = bitcast<f32>(state.x);
        replay.end = state.y;
#endif
        replay.behind = dot(replay.by_rgb, step.background) * replay.transmittance;
    }
    return replay;
}

#if STATISTICS
// The loss of a pixel of the image.
fn pixel_loss(pixel: vec2u) -> f32 {
    let at = pixel.y * step.size_px.x + pixel.x;
#if GEOMETRY
    return pixel_records[3u * at].w;
#else
    return pixel_grad[at].w;
#endif
}
#endif

// Texture coordinates of samples without texels: far from every texel.
const NOWHERE = vec2f(-1e9);

// Derivatives by a sample; `SampleGradient()` with the coordinate NOWHERE if it was not blended.
struct SampleGradient {
    // By the coordinates on the surfel, over the denominator, and by the denominator.
    by_hit: vec3f,
    // By the opacity.
    by_falloff: f32,
    // Coordinates on the surfel.
    plane: vec2f,
    by_colour: vec3f,
    // Texture coordinates.
    coordinate: vec2f,
    weight: f32,
#if GEOMETRY
    // By m.
    by_m: f32,
#endif
}

fn is_blended(replay: ptr<function, Replay>, s: Projected, index: u32, hit: Hit, pixel: vec2u) -> bool {
    return hit.inside && index < (*replay).end && in_box(s, pixel);
}

// The derivatives by a sample that was blended, the last one before those that the replay has passed.
fn sample_bwd(replay: ptr<function, Replay>, s: Projected, index: u32, hit: Hit, taps: Taps) -> SampleGradient {
    var out = SampleGradient();
    let alpha = min(hit.raw_alpha, ALPHA_MAX);
    let per_rest = 1.0 / (1.0 - alpha);
    let before = (*replay).transmittance * per_rest;
    let weight = alpha * before;
    var texture = Residual(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    out.coordinate = NOWHERE;
    if taps.inside {
        texture = residual(s, taps);
        out.coordinate = taps.coordinate;
    }
    let colour = max(s.rgb, vec3f(0.0)) + texture.value;
    let by_rgb = (*replay).by_rgb;
#if GEOMETRY
    let m = s.near_over_depth * hit.denominator;
    let c = (*replay).by_moments;
    let along = dot((*replay).towards, normals[pairs[index]].xyz);
    let by_weight = dot(by_rgb, max(colour, vec3f(0.0))) + (c.x + (c.y + c.z * m) * m + along);
    out.by_m = weight * (c.y + 2.0 * c.z * m);
#else
    let by_weight = dot(by_rgb, max(colour, vec3f(0.0)));
#endif
    let by_alpha = before * by_weight - (*replay).behind * per_rest;
    (*replay).behind += weight * by_weight;
    (*replay).transmittance = before;

    // The gradient passes where the colour is positive or descent would raise it.
    let passes = (colour > vec3f(0.0)) | (by_rgb < vec3f(0.0));
    out.by_colour = select(vec3f(0.0), by_rgb * weight, passes);
    out.by_falloff = select(0.0, by_alpha * hit.falloff, hit.raw_alpha <= ALPHA_MAX);
    out.plane = hit.plane;
    out.weight = weight;
    let by_coordinate = vec2f(dot(out.by_colour, texture.by_u), dot(out.by_colour, texture.by_v));
    let t = s.texels_per_coordinate;
    let by_texture = vec2f(by_coordinate.x * t.x + by_coordinate.y * t.y, by_coordinate.y * t.z);
    let by_hit = (by_texture - out.by_falloff * s.opacity * hit.plane) * hit.per_denominator;
#if GEOMETRY
    out.by_hit = vec3f(by_hit, out.by_m * s.near_over_depth - dot(by_hit, hit.plane));
#else
    out.by_hit = vec3f(by_hit, -dot(by_hit, hit.plane));
#endif
    return out;
}
