// The fast path: one sample of a splat. Premultiplied, for blending from back to front.

uniform sampler2D atlas; // texels in [-1, 1] as (127 t + 128) / 255: an exact zero
#ifdef EXACT_DEPTH
uniform float near;
flat in float centreDepth;
#endif

in vec3 offset;
flat in vec4 base;
flat in vec4 fromOffset;
flat in float centreRow;
flat in vec4 limits;

out vec4 colourAndAlpha;

void main() {
#ifdef EXACT_DEPTH
    if (offset.z <= 0.0 || centreDepth < near * offset.z) discard;
#endif
    vec2 s = offset.xy / offset.z;
    float alpha = base.a * exp(-0.5 * dot(s, s));
    if (alpha < ALPHA_MIN) discard;
    alpha = min(ALPHA_MAX, alpha);
#ifdef LOGARITHMIC_DEPTH
    gl_FragDepth = windowDepth(centreDepth / offset.z);
#endif
    vec3 colour = base.rgb;
    if (limits.z > 0.0) {
        vec2 at = vec2(fromOffset.y * s.x + fromOffset.z * s.y + fromOffset.w, fromOffset.x * s.x + centreRow);
        vec3 texel = texture(atlas, clamp(at, limits.xy, limits.zw)).rgb;
        colour = max(vec3(0.0), colour + texel * (255.0 / 127.0) - 128.0 / 127.0);
    }
#ifdef SHOWS_DEPTH
    colour = shownDepth(centreDepth / offset.z);
#endif
    colourAndAlpha = vec4(converted(colour) * alpha, alpha);
}
