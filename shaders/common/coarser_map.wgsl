// A map whose texels are averaged in pairs along some axes (twin: src/model/coarsening.rs).

// The texels of a map along one axis, in pairs or each by itself.
struct CoarserAxis {
    texels: u32,
    // Texels after averaging.
    count: u32,
    is_coarser: bool,
    // 1 if the first texel has no partner.
    alone: u32,
}

struct CoarserMap {
    u: CoarserAxis,
    v: CoarserAxis,
    // False for maps of less than two texels along a coarser axis.
    exists: bool,
}

// Two coarse texels, with the weights of their values: 0 outside of the map.
struct CoarseTaps {
    texels: vec2u,
    weights: vec2f,
}

// The map's origin has the splat's centre at (texels - 1 - shift) / 2; coarse edges meet at that centre.
fn coarser_axis(texels: u32, origin: f32, is_coarser: bool) -> CoarserAxis {
    // Half texels from the centre to the first edge.
    let edge = -1 - i32(round(2.0 * origin));
    // Floor of the half, and its parity.
    let first_edge = edge >> 1u;
    let alone = u32(first_edge & 1);
    let count = select(texels, (texels + alone + 1u) / 2u, is_coarser);
    return CoarserAxis(texels, count, is_coarser, alone);
}

fn coarser_map(info: SplatInfo, along_u: bool, along_v: bool) -> CoarserMap {
    let rows = map_rows(info.map_size);
    let cols = map_cols(info.map_size);
    let exists = !(along_u && rows < 2u) && !(along_v && cols < 2u);
    let u = coarser_axis(rows, info.map_origin.x, along_u);
    return CoarserMap(u, coarser_axis(cols, info.map_origin.y, along_v), exists);
}

// The two texels of a coarse one; the same twice if it has only one.
fn pair_of(axis: CoarserAxis, coarse: u32) -> vec2u {
    if !axis.is_coarser {
        return vec2u(coarse);
    }
    let first = max(2u * coarse, axis.alone) - axis.alone;
    let second = 2u * coarse + 1u - axis.alone;
    return min(vec2u(first, second), vec2u(axis.texels - 1u));
}

// The coarse texels between which a texel's centre lies.
fn taps(axis: CoarserAxis, texel: u32) -> CoarseTaps {
    var first = i32(texel);
    var share = 0.0;
    if axis.is_coarser {
        // At (texel + alone) / 2 - 1/4.
        let at = i32(texel + axis.alone);
        first = ((at + 1) >> 1u) - 1;
        share = select(0.25, 0.75, at % 2 == 0);
    }
    let last = i32(axis.count) - 1;
    let both = vec2i(first, first + 1);
    let is_inside = (both >= vec2i(0)) & (both <= vec2i(last));
    let weights = select(vec2f(0.0), vec2f(1.0 - share, share), is_inside);
    return CoarseTaps(vec2u(clamp(both, vec2i(0), vec2i(last))), weights);
}
