// One sample of a splat: exporters/schema/gltf.md, section 6, steps 2 to 7. Premultiplied, for blending from back to front.
precision highp float;
precision highp int;
precision highp sampler2D;

const float ALPHA_MIN = 1.0 / 255.0;
const float ALPHA_MAX = 0.99;
const float D_MIN = 0.0001;

uniform sampler2D texels; // RGB of one texel per texel
uniform float near;
uniform vec2 size; // px
uniform vec2 origin; // of the viewport, px
#ifdef LOGARITHMIC_DEPTH
uniform vec2 logDepth; // depth of the window = x log2(1 + y distance along the axis)
#endif
#ifdef SHOWS_DEPTH
uniform vec2 depthRange; // logarithms of depths that are white and black
#endif

flat in vec4 centreAndPlane;
flat in vec4 falloff;
flat in vec4 texture_;
flat in vec4 originAndFootprint;
flat in vec4 base;
flat in ivec3 map;
flat in float centreDepth;

out vec4 colourAndAlpha;

// Mean of the map over the footprint around uv; zero outside the map.
vec3 residual(vec2 uv, vec2 footprint) {
    vec2 reach = 0.5 * (footprint + 1.0);
    ivec2 low = max(ivec2(ceil(uv - reach)), ivec2(0));
    ivec2 high = min(ivec2(floor(uv + reach)), map.xy - 1);
    int width = textureSize(texels, 0).x;
    vec3 sum = vec3(0.0);
    for (int i = low.x; i <= high.x; i++) {
        float weight = clamp(reach.x - abs(uv.x - float(i)), 0.0, 1.0);
        vec3 row = vec3(0.0);
        int index = map.z + i * map.y;
        for (int j = low.y; j <= high.y; j++) {
            row += clamp(reach.y - abs(uv.y - float(j)), 0.0, 1.0) * texelFetch(texels, ivec2((index + j) % width, (index + j) / width), 0).rgb;
        }
        sum += weight * row;
    }
    return sum / (footprint.x * footprint.y);
}

// From sRGB code values to linear light, the reverse, or as they are. A variant each, like all that a uniform would decide: software
// runs both ways of such a branch.
vec3 converted(vec3 c) {
#if defined(TO_LINEAR)
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
#elif defined(TO_SRGB)
    return mix(12.92 * c, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
#else
    return c;
#endif
}

void main() {
    vec2 pixel = gl_FragCoord.xy - origin;
    vec2 q = vec2(pixel.x, size.y - pixel.y) - centreAndPlane.xy;
#ifdef COUNT_FRAGMENTS
    colourAndAlpha = vec4(1.0);
    return;
#endif
    float d = 1.0 + dot(centreAndPlane.zw, q);
    if (d < D_MIN || centreDepth < near * d) discard;
    vec2 s = vec2(dot(falloff.xy, q), dot(falloff.zw, q)) / d;
    float alpha = base.a * exp(-0.5 * dot(s, s));
    if (alpha < ALPHA_MIN) discard;
    alpha = min(ALPHA_MAX, alpha);
#ifdef LOGARITHMIC_DEPTH
    gl_FragDepth = logDepth.x * log2(1.0 + logDepth.y * centreDepth / d);
#endif
#ifdef COUNT_DRAWN
    colourAndAlpha = vec4(1.0);
    return;
#endif
    vec3 colour = base.rgb;
    if (map.x > 0) {
        vec2 uv = vec2(dot(texture_.xy, q), dot(texture_.zw, q)) / d + originAndFootprint.xy;
        colour = max(vec3(0.0), colour + residual(uv, originAndFootprint.zw));
    }
#ifdef SHOWS_DEPTH
    colour = vec3(1.0 - clamp((log(centreDepth / d) - depthRange.x) / (depthRange.y - depthRange.x), 0.0, 1.0));
#endif
    colourAndAlpha = vec4(converted(colour) * alpha, alpha);
}
