// The exact path: one sample of a splat, exporters/schema/gltf.md, section 6, steps 2 to 7. Premultiplied, for blending from back to front.
const float D_MIN = 0.0001;

uniform sampler2D texels; // RGB of one texel per texel
uniform float near;
uniform vec2 size; // px
uniform vec2 origin; // of the viewport, px

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
    gl_FragDepth = windowDepth(centreDepth / d);
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
    colour = shownDepth(centreDepth / d);
#endif
    colourAndAlpha = vec4(converted(colour) * alpha, alpha);
}
