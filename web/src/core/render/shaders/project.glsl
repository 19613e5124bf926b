// Splats in an image: exporters/schema/gltf.md, section 5, and section 6, step 1. Shared by the exact path, which projects each corner of
// a quad, and by the fast one, which projects each splat once.
//
// Everything a sample needs is affine in q, the pixel relative to the projected centre (y down): with D = 1 + plane . q,
// the standardised offset on the surfel is (falloffU . q, falloffV . q) / D, and so are the texture coordinates.

const float EDGE_ON = 0.001;
const float ALPHA_MIN = 1.0 / 255.0;
const float FILTER_VARIANCE_PX2 = 0.1;
const float FOOTPRINT_MAX = 8.0;
// Below this margin to the camera's plane the outline of a splat in the image is clipped as a polygon. Measured: at 0.05
// f32 places the outline to 0.02 px.
const float OUTLINE_MARGIN = 0.05;
// Longer half axes are clipped, too: records hold them in 16 bits.
const float OUTLINE_MAX_PX = 16384.0;
// Pixel centres are snapped to 1/256 px or finer.
const float SNAP_PX = 0.05;

uniform usampler2D splats; // 4 texels per splat, see pack.ts
uniform sampler2D sh; // RGB of one coefficient per texel
uniform sampler2D means; // RGB per splat: weighted mean of its map
uniform usampler2D order; // splats from far to near, one per texel
uniform int drawn; // of the order
uniform uint budget; // splats from this one on are not drawn
uniform mat3 cameraFromData;
uniform vec3 translation; // of cameraFromData
uniform vec3 cameraInData;
uniform vec2 focal; // px
uniform vec2 principal; // px
uniform vec2 size; // px
uniform float near; // units of the data
uniform bool filtered; // "ewa"
uniform float growth; // of the first `grown` splats, where others are missing
uniform uint grown;
uniform int colours; // COLOURS_*, see colours.ts
uniform vec3 classColours[9];

struct Projected {
    uint splat;
    vec3 position;
    vec3 centre; // projected, px, y down; distance along the axis
    vec2 plane;
    vec2 falloffU, falloffV;
    // The outline: middle + x axes[0] + y axes[1] for x and y in [-1, 1], px from the centre.
    vec2 middle;
    mat2 axes;
    vec2 u, v; // texture coordinates per q: texels
    vec3 fromOffset; // of the same by the standardised offset: u = x s.x, v = y s.x + z s.y
    vec2 footprint; // F_u, F_v: texels
    ivec2 side; // rows and columns; 0 without a map
    vec2 shift; // half texels
    uint firstTexel;
    uint firstSh;
    int degree;
    float opacity; // filtered
};

vec3 rotate(vec4 xyzw, vec3 v) {
    return v + 2.0 * cross(xyzw.xyz, cross(xyzw.xyz, v) + xyzw.w * v);
}

vec3 coefficient(int index) {
    return texelFetch(sh, texelOf(index, textureSize(sh, 0).x), 0).rgb;
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

// Splat number `slot` of the order; false where nothing of it can be seen.
bool project(int slot, out Projected result) {
    uint splat = texelFetch(order, texelOf(slot, textureSize(order, 0).x), 0).r;
    if (splat >= budget) return false;
    ivec2 at = texelOf(4 * int(splat), textureSize(splats, 0).x);
    vec4 first = uintBitsToFloat(texelFetch(splats, at, 0));
    vec3 position = first.xyz;
    float opacity = first.w;
    vec4 rotation = uintBitsToFloat(texelFetch(splats, at + ivec2(1, 0), 0));
    vec4 third = uintBitsToFloat(texelFetch(splats, at + ivec2(2, 0), 0));
    uvec4 last = texelFetch(splats, at + ivec2(3, 0), 0);
    third *= splat < grown ? growth : 1.0;
    vec2 sigma = third.xy, texelSize = max(third.zw, vec2(1.0e-38));

    vec3 p = cameraFromData * position + translation;
    if (!(p.z >= near) || opacity < ALPHA_MIN) return false;
    vec3 eu = cameraFromData * rotate(rotation, vec3(1.0, 0.0, 0.0));
    vec3 ev = cameraFromData * rotate(rotation, vec3(0.0, 1.0, 0.0));
    vec3 n = cross(eu, ev);
    float pn = dot(p, n);
    if (!(abs(pn) >= EDGE_ON * length(p))) return false;

    float w = pn / p.z;
    vec2 a = cross(ev, p).xy / (focal * w), b = cross(p, eu).xy / (focal * w);
    vec2 mu = a / sigma.x, mv = b / sigma.y; // rows of M
    float detM = p.z * p.z / (focal.x * focal.y * w * sigma.x * sigma.y);
    float variance = filtered ? FILTER_VARIANCE_PX2 : 0.0;
    float vuu = 1.0 + variance * dot(mu, mu), vuv = variance * dot(mu, mv);
    float detV = 1.0 + variance * (dot(mu, mu) + dot(mv, mv)) + (variance * detM) * (variance * detM);
    opacity *= inversesqrt(detV);
    if (opacity < ALPHA_MIN) return false;
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
    vec2 middle = ePlane / margin;
    mat2 axes = halfAxes(e / margin + vec3(middle.x * middle.x, middle.x * middle.y, middle.y * middle.y));
    if (!(margin > OUTLINE_MARGIN && dot(axes[0], axes[0]) < OUTLINE_MAX_PX * OUTLINE_MAX_PX)) {
        float reach = sqrt(reach2), lu = sqrt(vuu);
        vec3 halfU = reach * (eu * sigma.x * lu + ev * (sigma.y * vuv / lu)), halfV = reach * ev * (sigma.y * sqrt(detV / vuu));
        vec4 bounds = clippedBounds(p, halfU, halfV);
        if (bounds.x >= bounds.z || bounds.y >= bounds.w) return false;
        middle = 0.5 * (bounds.xy + bounds.zw) - principal - centre;
        axes = mat2(0.5 * (bounds.z - bounds.x), 0.0, 0.0, 0.5 * (bounds.w - bounds.y));
    }
    int rows = int(last.x & 0xffffu), cols = int(last.x >> 16);
    vec2 span = vec2(length(a), length(b)) / texelSize; // texels per pixel
    result.splat = splat;
    result.position = position;
    result.centre = vec3(principal + centre, p.z);
    result.plane = plane;
    result.falloffU = falloffU;
    result.falloffV = falloffV;
    result.middle = middle;
    result.axes = axes;
    result.u = a / texelSize.x;
    result.v = b / texelSize.y;
    result.fromOffset = vec3(sqrt(vuu) * sigma.x / texelSize.x, vec2(vuv * inversesqrt(vuu), sqrt(detV / vuu)) * (sigma.y / texelSize.y));
    result.footprint = filtered ? min(vec2(FOOTPRINT_MAX), sqrt(max(vec2(1.0), 2.0 * span * span - 1.0))) : vec2(1.0);
    result.side = ivec2(rows, cols);
    result.shift = vec2(float(int(last.y << 16) >> 16), float(int(last.y) >> 16));
    result.firstTexel = last.z;
    result.firstSh = last.w & 0x3fffffffu;
    result.degree = int(last.w >> 30);
    result.opacity = opacity;
    return true;
}

// The base colour that is shown of a splat.
vec3 colourOf(Projected p) {
    if (colours == COLOURS_TEXELS) return classColours[sideClass(max(p.side.x, p.side.y))];
    if (colours == COLOURS_DEGREE) return classColours[p.degree];
    vec3 colour = unclampedColour(normalize(p.position - cameraInData), int(p.firstSh), p.degree);
    if (colours == COLOURS_UNTEXTURED) colour += texelFetch(means, texelOf(int(p.splat), textureSize(means, 0).x), 0).rgb;
    return max(vec3(0.0), colour);
}
