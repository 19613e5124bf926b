// Maps into the atlas: a quad over the block of each splat that has one, a batch an instance.
uniform usampler2D splats; // see pack.ts
uniform usampler2D places; // column, row of the block, 16 bits each
uniform int first; // splat
uniform int end;
uniform int halvings;
uniform vec2 atlasSize; // texels

flat out ivec4 map; // rows, columns, first texel, -
flat out ivec2 block;

// Texels of a block along an axis: each copy behind its border.
int extent(int side) {
    ivec2 last = copyOf(side, halvings);
    return last.x + last.y;
}

void main() {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    int splat = first + SPLATS_PER_BATCH * gl_InstanceID + (gl_VertexID >> 2);
    if (splat >= end) return;
    uint place = texelFetch(places, texelOf(splat, textureSize(places, 0).x), 0).r;
    if (place == NO_PLACE) return;
    uvec4 last = texelFetch(splats, texelOf(4 * splat + 3, textureSize(splats, 0).x), 0);
    map = ivec4(last.x & 0xffffu, last.x >> 16, last.z, 0);
    block = ivec2(place & 0xffffu, place >> 16);
    vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1 & 1));
    vec2 at = vec2(block) + corner * vec2(extent(map.y), extent(map.x));
    gl_Position = vec4(2.0 * at / atlasSize - 1.0, 0.0, 1.0);
}
