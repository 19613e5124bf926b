// The finished image for a target of 8 bits: clamped, and encoded as sRGB if it is linear light.
precision highp float;
precision highp sampler2D;

uniform sampler2D image; // premultiplied
uniform bool linear;

out vec4 result;

vec3 encoded(vec3 c) {
    return mix(12.92 * c, 1.055 * pow(max(c, 0.0031308), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

void main() {
    vec4 value = texelFetch(image, ivec2(gl_FragCoord.xy), 0);
    float alpha = clamp(value.a, 0.0, 1.0);
    vec3 colour = clamp(value.rgb, 0.0, 1.0);
    if (linear && alpha > 0.0) colour = encoded(clamp(colour / alpha, 0.0, 1.0)) * alpha;
    result = vec4(min(colour, alpha), alpha);
}
