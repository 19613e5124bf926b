// Splats as quads of the image, a batch an instance: exporters/schema/gltf.md, section 5, and section 6, step 1.
//
// Everything a sample needs is affine in q, the pixel relative to the projected centre (y down): with D = 1 + plane . q,
// the standardised offset on the surfel is (falloffU . q, falloffV . q) / D, and so are the texture coordinates.
precision highp float;
precision highp int;
precision highp usampler2D;

const float EDGE_ON = 0.001;
const float ALPHA_MIN = 1.0 / 255.0;
const float FILTER_VARIANCE_PX2 = 0.1;
const float FOOTPRINT_MAX = 8.0;
// Below this margin to the camera's plane the outline of a splat in the image is clipped as a polygon. Measured: at 0.05
// f32 places the outline to 0.02 px.
const float OUTLINE_MARGIN = 0.05;
// Pixel centres are snapped to 1/256 px or finer.
const float SNAP_PX = 0.05;

uniform usampler2D splats; // 4 texels per splat, see pack.ts
uniform sampler2D sh; // RGB of one coefficient per texel
uniform sampler2D means; // RGB per splat: weighted mean of its map
uniform mat3 cameraFromData;
uniform vec3 translation; // of cameraFromData
uniform vec3 cameraInData;
uniform vec2 focal; // px
uniform vec2 principal; // px
uniform vec2 size; // px
uniform float near; // units of the data
uniform vec2 depthFromInverse; // depth of clip space = x + y / distance along the axis + depthSlope . (px from the principal point)
uniform vec2 depthSlope; // per px, right and down: 0 but for near planes that are not parallel to the image
uniform bool filtered; // "ewa"
uniform float growth; // of the first `grown` splats, where others are missing
uniform uint grown;
uniform int colours; // COLOURS_*, see colours.ts
uniform vec3 classColours[9];

uniform usampler2D order; // splats from far to near, one per texel
uniform int drawn; // of the order

flat out vec4 centreAndPlane; // projected centre, px, y down; plane
flat out vec4 falloff; // falloffU, falloffV
flat out vec4 texture_; // texture coordinates per q, along u and v
flat out vec4 originAndFootprint; // texture coordinates of the centre; F_u, F_v
flat out vec4 base; // base colour; opacity, filtered
flat out ivec3 map; // rows, columns, first texel
flat out float centreDepth;

vec3 rotate(vec4 xyzw, vec3 v) {
    return v + 2.0 * cross(xyzw.xyz, cross(xyzw.xyz, v) + xyzw.w * v);
}

vec3 coefficient(int index) {
    int width = textureSize(sh, 0).x;
    return texelFetch(sh, ivec2(index % width, index / width), 0).rgb;
}

// Section 5 before the clamp, with d the unit direction from the camera to the centre.
vec3 unclampedColour(vec3 d, int first, int degree) {
    vec3 sum = 0.28209479177387814 * coefficient(first);
    float x = d.x, y = d.y, z = d.z;
    if (degree >= 1) {
        sum += -0.4886025119029199 * y * coefficient(first + 1) + 0.4886025119029199 * z * coefficient(first + 2)
            - 0.4886025119029199 * x * coefficient(first + 3);
    }
    if (degree >= 2) {
        sum += 1.0925484305920792 * x * y * coefficient(first + 4) - 1.0925484305920792 * y * z * coefficient(first + 5)
            + 0.31539156525252005 * (2.0 * z * z - x * x - y * y) * coefficient(first + 6)
            - 1.0925484305920792 * x * z * coefficient(first + 7)
            + 0.5462742152960396 * (x * x - y * y) * coefficient(first + 8);
    }
    if (degree >= 3) {
        sum += -0.5900435899266435 * y * (3.0 * x * x - y * y) * coefficient(first + 9)
            + 2.890611442640554 * x * y * z * coefficient(first + 10)
            - 0.4570457994644658 * y * (4.0 * z * z - x * x - y * y) * coefficient(first + 11)
            + 0.3731763325901154 * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y) * coefficient(first + 12)
            - 0.4570457994644658 * x * (4.0 * z * z - x * x - y * y) * coefficient(first + 13)
            + 1.445305721320277 * z * (x * x - y * y) * coefficient(first + 14)
            - 0.5900435899266435 * x * (x * x - 3.0 * y * y) * coefficient(first + 15);
    }
    return 0.5 + sum;
}

// 0 without a map; 1 to 8 for sides of up to 2, 4, ..., 256 and more.
int sideClass(int side) {
    int c = side > 0 ? 1 : 0;
    for (int limit = 2; c > 0 && c < 8 && side > limit; limit *= 2) c++;
    return c;
}

// Half axes of the outline: eigenvectors of a symmetric matrix (xx, xy, yy), as long as the roots of its eigenvalues.
mat2 halfAxes(vec3 s) {
    float mean = 0.5 * (s.x + s.z), half_ = 0.5 * (s.x - s.z);
    float radius = length(vec2(half_, s.y));
    float large = mean + radius;
    // The determinant over the large one: a difference of both would lose the digits of thin splats.
    float small = max(0.0, (s.x * s.z - s.y * s.y) / large);
    vec2 axis = half_ >= 0.0 ? vec2(half_ + radius, s.y) : vec2(s.y, radius - half_);
    axis = dot(axis, axis) > 0.0 ? normalize(axis) : vec2(1.0, 0.0);
    return mat2(axis * (sqrt(large) + SNAP_PX), vec2(-axis.y, axis.x) * (sqrt(small) + SNAP_PX));
}

// Bounds in pixels (min, max) of a parallelogram with this centre and half sides, of what lies beyond the near plane.
vec4 clippedBounds(vec3 centre, vec3 halfU, vec3 halfV) {
    vec3 corners[4] = vec3[4](centre - halfU - halfV, centre + halfU - halfV, centre + halfU + halfV, centre - halfU + halfV);
    vec2 low = vec2(3.0e38), high = vec2(-3.0e38);
    for (int i = 0; i < 4; i++) {
        vec3 from = corners[i], to = corners[(i + 1) % 4];
        if (from.z >= near) {
            vec2 at = focal * from.xy / from.z;
            low = min(low, at);
            high = max(high, at);
        }
        if ((from.z >= near) != (to.z >= near)) {
            vec2 at = focal * mix(from.xy, to.xy, (near - from.z) / (to.z - from.z)) / near;
            low = min(low, at);
            high = max(high, at);
        }
    }
    low = max(low + principal - 1.0, vec2(0.0));
    high = min(high + principal + 1.0, size);
    return vec4(low, high);
}

void main() {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside: no fragments
    int slot = SPLATS_PER_BATCH * gl_InstanceID + (gl_VertexID >> 2);
    if (slot >= drawn) return;
    int orderWidth = textureSize(order, 0).x;
    uint splat = texelFetch(order, ivec2(slot % orderWidth, slot / orderWidth), 0).r;
    int width = textureSize(splats, 0).x;
    ivec2 at = ivec2(int(splat % uint(width / 4)) * 4, int(splat / uint(width / 4)));
    vec4 first = uintBitsToFloat(texelFetch(splats, at, 0));
    vec3 position = first.xyz;
    float opacity = first.w;
    vec4 rotation = uintBitsToFloat(texelFetch(splats, at + ivec2(1, 0), 0));
    vec4 third = uintBitsToFloat(texelFetch(splats, at + ivec2(2, 0), 0));
    uvec4 last = texelFetch(splats, at + ivec2(3, 0), 0);
    third *= splat < grown ? growth : 1.0;
    vec2 sigma = third.xy, texelSize = third.zw;

    vec3 p = cameraFromData * position + translation;
    if (!(p.z >= near) || opacity < ALPHA_MIN) return;
    vec3 eu = cameraFromData * rotate(rotation, vec3(1.0, 0.0, 0.0));
    vec3 ev = cameraFromData * rotate(rotation, vec3(0.0, 1.0, 0.0));
    vec3 n = cross(eu, ev);
    float pn = dot(p, n);
    if (!(abs(pn) >= EDGE_ON * length(p))) return;

    float w = pn / p.z;
    vec2 a = cross(ev, p).xy / (focal * w), b = cross(p, eu).xy / (focal * w);
    vec2 mu = a / sigma.x, mv = b / sigma.y; // rows of M
    float detM = p.z * p.z / (focal.x * focal.y * w * sigma.x * sigma.y);
    float variance = filtered ? FILTER_VARIANCE_PX2 : 0.0;
    float vuu = 1.0 + variance * dot(mu, mu), vuv = variance * dot(mu, mv);
    float detV = 1.0 + variance * (dot(mu, mu) + dot(mv, mv)) + (variance * detM) * (variance * detM);
    opacity *= inversesqrt(detV);
    if (opacity < ALPHA_MIN) return;
    // V = L L^T; these are the rows of L^-1 M. (The bracket is vuu mv - vuv mu without its cancellation.)
    vec2 falloffU = mu * inversesqrt(vuu);
    vec2 falloffV = (mv + variance * detM * vec2(-mu.y, mu.x)) * inversesqrt(vuu * detV);
    vec2 plane = n.xy / (focal * w);
    vec2 centre = focal * p.xy / p.z;

    // The outline |L^-1 s| = reach: at the centre an ellipse of the image with the matrix e, in perspective the one
    // of the dual conic ((e, -e plane), (-plane e, plane e plane - 1)).
    float reach2 = 2.0 * log(255.0 * opacity);
    vec2 ju = focal * (eu.xy - p.xy / p.z * eu.z) * (sigma.x / p.z), jv = focal * (ev.xy - p.xy / p.z * ev.z) * (sigma.y / p.z);
    vec3 e = reach2 * (vec3(ju.x * ju.x + jv.x * jv.x, ju.x * ju.y + jv.x * jv.y, ju.y * ju.y + jv.y * jv.y)
        + vec3(variance, 0.0, variance));
    vec2 ePlane = vec2(e.x * plane.x + e.y * plane.y, e.y * plane.x + e.z * plane.y);
    float margin = 1.0 - dot(plane, ePlane);
    vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1 & 1));
    vec2 q;
    if (margin > OUTLINE_MARGIN) {
        vec2 middle = ePlane / margin;
        mat2 axes = halfAxes(e / margin + vec3(middle.x * middle.x, middle.x * middle.y, middle.y * middle.y));
        q = middle + axes * (2.0 * corner - 1.0);
    } else {
        float reach = sqrt(reach2), lu = sqrt(vuu);
        vec3 halfU = reach * (eu * sigma.x * lu + ev * (sigma.y * vuv / lu)), halfV = reach * ev * (sigma.y * sqrt(detV / vuu));
        vec4 bounds = clippedBounds(p, halfU, halfV);
        if (bounds.x >= bounds.z || bounds.y >= bounds.w) return;
        q = mix(bounds.xy, bounds.zw, corner) - principal - centre;
    }
    vec2 pixel = principal + centre + q;
    // 1 / depth of the surfel is affine in the image, so its depth in clip space is right everywhere on the quad.
    float depth = depthFromInverse.x + depthFromInverse.y * (1.0 + dot(plane, q)) / p.z + dot(depthSlope, centre + q);
    gl_Position = vec4(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y, depth, 1.0);

    int rows = int(last.x & 0xffffu), cols = int(last.x >> 16);
    vec2 shift = vec2(float(int(last.y << 16) >> 16), float(int(last.y) >> 16));
    int degree = int(last.w >> 30), firstSh = int(last.w & 0x3fffffffu);
    vec3 colour = unclampedColour(normalize(position - cameraInData), firstSh, degree);
    if (colours == COLOURS_UNTEXTURED) {
        int meansWidth = textureSize(means, 0).x;
        colour += texelFetch(means, ivec2(int(splat) % meansWidth, int(splat) / meansWidth), 0).rgb;
    } else if (colours == COLOURS_TEXELS) {
        colour = classColours[sideClass(max(rows, cols))];
    } else if (colours == COLOURS_DEGREE) {
        colour = classColours[degree];
    }
    colour = max(vec3(0.0), colour);
    if (colours != COLOURS_TRAINED) rows = 0;
    vec2 span = vec2(length(a), length(b)) / max(texelSize, vec2(1.0e-38)); // texels per pixel
    vec2 footprint = filtered ? min(vec2(FOOTPRINT_MAX), sqrt(max(vec2(1.0), 2.0 * span * span - 1.0))) : vec2(1.0);

    centreAndPlane = vec4(principal + centre, plane);
    falloff = vec4(falloffU, falloffV);
    texture_ = rows == 0 ? vec4(0.0) : vec4(a / texelSize.x, b / texelSize.y);
    originAndFootprint = vec4(0.5 * (vec2(float(rows), float(cols)) - 1.0 - shift), footprint);
    base = vec4(colour, opacity);
    map = ivec3(rows, cols, int(last.z));
    centreDepth = p.z;
}
