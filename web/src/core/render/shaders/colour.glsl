// Colours of fragments. What a uniform would decide is a variant each: software runs both ways of such a branch.
precision highp float;
precision highp int;
precision highp sampler2D;

const float ALPHA_MIN = 1.0 / 255.0;
const float ALPHA_MAX = 0.99;

// From sRGB code values to linear light, the reverse, or as they are.
vec3 converted(vec3 c) {
#if defined(TO_LINEAR)
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
#elif defined(TO_SRGB)
    return mix(12.92 * c, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
#else
    return c;
#endif
}

#ifdef SHOWS_DEPTH
uniform vec2 depthRange; // logarithms of depths that are white and black

vec3 shownDepth(float depth) {
    return vec3(1.0 - clamp((log(depth) - depthRange.x) / (depthRange.y - depthRange.x), 0.0, 1.0));
}
#endif

#ifdef LOGARITHMIC_DEPTH
uniform vec2 logDepth; // depth of the window = x log2(1 + y distance along the axis)

float windowDepth(float depth) {
    return logDepth.x * log2(1.0 + logDepth.y * depth);
}
#endif
