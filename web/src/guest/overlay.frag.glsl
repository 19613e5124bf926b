// Splats over what stands behind them, both premultiplied: blended in the space of the splats, in that of the target.
precision highp float;
precision highp int;
precision highp sampler2D;

uniform sampler2D splats; // of the target's size
uniform sampler2D behind; // in the space of the target
uniform bool linear; // the target holds linear light, the splats sRGB code values; else the reverse

out vec4 result;

#ifdef GAMMA // some engines take a power for the curve of sRGB
vec3 decoded(vec3 c) {
    return pow(max(c, 0.0), vec3(GAMMA));
}

vec3 encoded(vec3 c) {
    return pow(max(c, 0.0), vec3(1.0 / GAMMA));
}
#else
vec3 decoded(vec3 c) {
    return mix(c / 12.92, pow((max(c, 0.0) + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
}

vec3 encoded(vec3 c) {
    return mix(12.92 * c, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}
#endif

void main() {
    vec4 front = texelFetch(splats, ivec2(gl_FragCoord.xy), 0);
    if (front.a <= 0.0) discard;
    vec4 back = texelFetch(behind, ivec2(gl_FragCoord.xy), 0);
    vec3 colour = back.a > 0.0 ? back.rgb / back.a : vec3(0.0);
    back.rgb = (linear ? encoded(colour) : decoded(colour)) * back.a;
    vec4 both = front + (1.0 - front.a) * back;
    colour = both.rgb / both.a;
    result = vec4((linear ? decoded(colour) : encoded(colour)) * both.a, both.a);
}
