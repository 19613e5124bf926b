// Where pools and blocks of the atlas have what shaders fetch.
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;

ivec2 texelOf(int index, int width) {
    return ivec2(index % width, index / width);
}

// Where the copy of a map begins that is halved this often along an axis, texels from the block's border; and its side.
ivec2 copyOf(int side, int halved) {
    int begin = 1;
    for (; halved > 0; halved--) {
        begin += side + 1;
        side = (side + 1) / 2;
    }
    return ivec2(begin, side);
}
