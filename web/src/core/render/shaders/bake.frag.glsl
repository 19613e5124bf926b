// A texel of the atlas: of a map, of a copy whose texels are means of 2, 4, ... of it, or of the border, which is zero.
precision highp float;
precision highp int;
precision highp sampler2D;

uniform sampler2D texels; // RGB of one texel per texel

flat in ivec4 map;
flat in ivec2 block;

out vec4 texel;

// Halvings of the copy that a texel of the block lies in, and its texel of that copy; -1 on the border.
ivec2 copyAt(int at, int side) {
    int halved = 0;
    for (; at > side; halved++) {
        at -= side + 1;
        side = (side + 1) / 2;
    }
    return ivec2(halved, at - 1);
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) - block;
    ivec2 alongV = copyAt(at.x, map.y), alongU = copyAt(at.y, map.x);
    vec3 sum = vec3(0.0);
    if (alongU.y >= 0 && alongV.y >= 0) {
        ivec2 low = ivec2(alongU.y << alongU.x, alongV.y << alongV.x), high = min(low + ivec2(1 << alongU.x, 1 << alongV.x), map.xy);
        int width = textureSize(texels, 0).x;
        for (int row = low.x; row < high.x; row++) {
            for (int col = low.y; col < high.y; col++) {
                int index = map.z + row * map.y + col;
                sum += texelFetch(texels, ivec2(index % width, index / width), 0).rgb;
            }
        }
        sum /= float(1 << (alongU.x + alongV.x));
    }
    texel = vec4((127.0 * clamp(sum, -1.0, 1.0) + 128.0) / 255.0, 1.0);
}
