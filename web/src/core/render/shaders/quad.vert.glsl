// The fast path, four times a splat: a quad from its record.
uniform usampler2D place, falloff, shape, paint; // records, see record.frag.glsl
uniform usampler2D splats; // see pack.ts
uniform sampler2D means; // RGB per splat: weighted mean of its map
uniform usampler2D places; // of maps in the atlas: column, row of the block, 16 bits each
uniform int drawn;
uniform vec2 size; // px
uniform vec2 atlasSize; // texels
#ifdef EXACT_DEPTH
uniform mat3 cameraFromData;
uniform vec3 translation;
uniform vec2 principal; // px
uniform vec2 depthFromInverse; // as in splat.vert.glsl
uniform vec2 depthSlope;
flat out float centreDepth;
#endif

out vec3 offset; // standardised offset and D, both numerators
flat out vec4 base; // base colour, opacity
flat out vec4 fromOffset; // texture coordinates by the standardised offset: x and z along, y across; the centre's column
flat out float centreRow;
flat out vec4 limits; // of texture coordinates: least, greatest

void setTexture(uint splat, uint copy, vec3 texelsFromOffset) {
    fromOffset = vec4(0.0);
    centreRow = 0.0;
    limits = vec4(0.0);
    if (copy == NO_MAP) return;
    uint block = texelFetch(places, texelOf(int(splat), textureSize(places, 0).x), 0).r;
    if (block == NO_PLACE) { // as viewers without textures show it
        base.rgb = max(vec3(0.0), base.rgb + texelFetch(means, texelOf(int(splat), textureSize(means, 0).x), 0).rgb);
        return;
    }
    uvec4 last = texelFetch(splats, texelOf(4 * int(splat) + 3, textureSize(splats, 0).x), 0);
    ivec2 sides = ivec2(last.x & 0xffffu, last.x >> 16);
    vec2 shift = vec2(float(int(last.y << 16) >> 16), float(int(last.y) >> 16));
    ivec2 halved = ivec2(copy & 3u, copy >> 2);
    ivec2 alongU = copyOf(sides.x, halved.x), alongV = copyOf(sides.y, halved.y);
    vec2 scale = 1.0 / vec2(1 << halved.x, 1 << halved.y);
    // Texel i of a map is centred at i, and at (i + 0.5) of its texels from the edge: halving keeps edges.
    vec2 centre = scale * 0.5 * (vec2(sides) - shift) - 0.5;
    vec2 first = vec2(block >> 16, block & 0xffffu) + vec2(alongU.x, alongV.x) + 0.5;
    vec2 side = vec2(alongU.y, alongV.y);
    vec2 perTexel = 1.0 / atlasSize.yx;
    // Rows of the atlas are along u: swapped, since textures are fetched by column and row.
    fromOffset = vec4(texelsFromOffset.x * scale.x * perTexel.x, texelsFromOffset.yz * scale.y * perTexel.y, (first.y + centre.y) * perTexel.y);
    centreRow = (first.x + centre.x) * perTexel.x;
    limits = vec4((first - 1.0) * perTexel, (first + side) * perTexel).yxwz;
}

void main() {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // outside: no fragments
    int slot = SPLATS_PER_BATCH * gl_InstanceID + (gl_VertexID >> 2);
    if (slot >= drawn) return;
    ivec2 at = texelOf(slot, RECORDS_PER_ROW);
    uvec4 painted = texelFetch(paint, at, 0);
    vec2 blueAndOpacity = unpackHalf2x16(painted.y);
    if (blueAndOpacity.y == 0.0) return;
    uvec4 placed = texelFetch(place, at, 0), shaped = texelFetch(shape, at, 0);
    vec4 fall = uintBitsToFloat(texelFetch(falloff, at, 0));
    vec2 plane = uintBitsToFloat(shaped.xy), last = unpackHalf2x16(placed.w);
    vec2 corner = 2.0 * vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1 & 1)) - 1.0;
    vec2 q = unpackHalf2x16(placed.z) + unpackHalf2x16(shaped.z) * corner.x + unpackHalf2x16(shaped.w) * corner.y;
    vec2 pixel = uintBitsToFloat(placed.xy) + q;
    offset = vec3(dot(fall.xy, q), dot(fall.zw, q), 1.0 + dot(plane, q));
#ifdef EXACT_DEPTH
    vec3 position = uintBitsToFloat(texelFetch(splats, texelOf(4 * int(painted.w & SPLAT_MASK), textureSize(splats, 0).x), 0).xyz);
    centreDepth = (cameraFromData * position + translation).z;
    float depth = depthFromInverse.x + depthFromInverse.y * offset.z / centreDepth + dot(depthSlope, pixel - principal);
#else
    // 1 / depth is affine in the image: at near it is -1 and cut off, at infinity 1.
    float depth = 1.0 - 2.0 * last.y * offset.z;
#endif
    gl_Position = vec4(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y, depth, 1.0);
    base = vec4(unpackHalf2x16(painted.x), blueAndOpacity);
    setTexture(painted.w & SPLAT_MASK, painted.w >> SPLAT_BITS, vec3(unpackHalf2x16(painted.z), last.x));
}
