// The fast path, once a splat: a record of what its quad and fragments need, in drawing order. Empty where nothing can be seen.
uniform int halvings; // of maps along each axis that the atlas holds
layout(location = 0) out uvec4 place; // centre, px; middle of the outline; z of fromOffset, near / depth
layout(location = 1) out uvec4 falloff; // falloffU, falloffV
layout(location = 2) out uvec4 shape; // plane; half axes of the outline
layout(location = 3) out uvec4 paint; // colour, opacity; x and y of fromOffset; splat and halvings

// What 16 bits hold.
const float HALF_MAX = 65000.0;
// Half axes are rounded to 11 bits: a little longer, they still cover the outline.
const float COVER = 1.001;

void main() {
    place = falloff = shape = paint = uvec4(0u);
    int slot = int(gl_FragCoord.y) * RECORDS_PER_ROW + int(gl_FragCoord.x);
    Projected p;
    if (slot >= drawn || !project(slot, p)) return;
    // The copy whose interpolation has the variance of the trained filter's: (F^2 + 2) / 3 = 4^l.
    vec2 halved = clamp(floor(0.5 * log2((p.footprint * p.footprint + 2.0) / 3.0) + 0.5), 0.0, float(halvings));
    uint copy = uint(halved.x) | uint(halved.y) << 2;
    if (p.side.x == 0 || colours != COLOURS_TRAINED) copy = NO_MAP;
    vec3 colour = min(colourOf(p), HALF_MAX), fromOffset = min(p.fromOffset, HALF_MAX);
    mat2 axes = COVER * p.axes;
    vec2 middle = clamp(p.middle, -HALF_MAX, HALF_MAX);
    place = uvec4(floatBitsToUint(p.centre.xy), packHalf2x16(middle), packHalf2x16(vec2(fromOffset.z, near / p.centre.z)));
    falloff = floatBitsToUint(vec4(p.falloffU, p.falloffV));
    shape = uvec4(floatBitsToUint(p.plane), packHalf2x16(axes[0]), packHalf2x16(axes[1]));
    paint = uvec4(packHalf2x16(colour.rg), packHalf2x16(vec2(colour.b, p.opacity)), packHalf2x16(fromOffset.xy), p.splat | copy << SPLAT_BITS);
}
