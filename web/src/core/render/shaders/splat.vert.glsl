// The exact path: splats as quads of the image, a batch an instance.
uniform vec2 depthFromInverse; // depth of clip space = x + y / distance along the axis + depthSlope . (px from the principal point)
uniform vec2 depthSlope; // per px, right and down: 0 but for near planes that are not parallel to the image

flat out vec4 centreAndPlane; // projected centre, px, y down; plane
flat out vec4 falloff; // falloffU, falloffV
flat out vec4 texture_; // texture coordinates per q, along u and v
flat out vec4 originAndFootprint; // texture coordinates of the centre; F_u, F_v
flat out vec4 base; // base colour; opacity, filtered
flat out ivec3 map; // rows, columns, first texel
flat out float centreDepth;

void main() {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside: no fragments
    int slot = SPLATS_PER_BATCH * gl_InstanceID + (gl_VertexID >> 2);
    Projected p;
    if (slot >= drawn || !project(slot, p)) return;
    vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1 & 1));
    vec2 q = p.middle + p.axes * (2.0 * corner - 1.0), pixel = p.centre.xy + q;
    // 1 / depth of the surfel is affine in the image, so its depth in clip space is right everywhere on the quad.
    float depth = depthFromInverse.x + depthFromInverse.y * (1.0 + dot(p.plane, q)) / p.centre.z + dot(depthSlope, pixel - principal);
    gl_Position = vec4(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y, depth, 1.0);

    bool textured = p.side.x > 0 && colours == COLOURS_TRAINED;
    centreAndPlane = vec4(p.centre.xy, p.plane);
    falloff = vec4(p.falloffU, p.falloffV);
    texture_ = textured ? vec4(p.u, p.v) : vec4(0.0);
    originAndFootprint = vec4(0.5 * (vec2(p.side) - 1.0 - p.shift), p.footprint);
    base = vec4(colourOf(p), p.opacity);
    map = textured ? ivec3(p.side, int(p.firstTexel)) : ivec3(0);
    centreDepth = p.centre.z;
}
