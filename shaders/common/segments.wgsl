// Segments of a tile's pairs: raster_bwd_subgroups visits each by a workgroup of its own, from the states of the pixels behind it
// (twin: gpu/segments.rs). raster_fwd stores these in `pairs`, behind the splats. Requires `pairs` and `tile_ranges` bound.
//
// A segment has `segment_pairs` pairs, the last of a tile what is left; if it is 0, tiles are whole. The boundary before pair b has
// the number b / segment_pairs. None has 0, and no two have the same: those of a tile lie segment_pairs apart, and the first one of
// a later tile lies segment_pairs behind that tile's first pair, which lies behind all boundaries of earlier tiles.

struct Segment {
    tile: u32,
    // The tile's first pair.
    tile_first: u32,
    // The segment's first pair, and one past the last. Empty: there is no segment.
    range: vec2u,
}

// What a workgroup visits: the first segment of a tile, or from `num_tiles` on that behind a boundary, by its number.
fn segment_of(group: u32) -> Segment {
    let num_tiles = step.grid.x * step.grid.y;
    let pairs_each = step.segment_pairs;
    if group < num_tiles {
        let range = tile_ranges[group];
        let past = select(range.y, min(range.y, range.x + pairs_each), pairs_each > 0u);
        return Segment(group, range.x, vec2u(range.x, past));
    }
    if pairs_each == 0u {
        return Segment();
    }
    // Such a boundary's tile begins before this pair and ends behind it: it is the last one that does not begin behind it.
    let pair = (group - num_tiles + 1u) * pairs_each;
    // Below num_tiles throughout.
    var tile = 0u;
    var past_tile = num_tiles;
    while past_tile - tile > 1u {
        let middle = (tile + past_tile) / 2u;
        if tile_ranges[middle].x <= pair {
            tile = middle;
        } else {
            past_tile = middle;
        }
    }
    let range = tile_ranges[tile];
    let first = range.x + (pair - range.x + (pairs_each - 1u)) / pairs_each * pairs_each;
    if first == range.x || first >= range.y {
        return Segment();
    }
    return Segment(tile, range.x, vec2u(first, min(range.y, first + pairs_each)));
}

// Place of the first value of a pixel's state at the boundary before a pair; those of all pixels lie together. The boundary has a
// number from 1 to (pair_capacity - 1) / segment_pairs, and `pairs` has room for these (`pair_bytes` in gpu/form.rs).
fn state_at(boundary: u32, lane: u32) -> u32 {
    return step.pair_capacity + (boundary / step.segment_pairs - 1u) * 4u * RASTER_GROUP + lane;
}

// The colour that the pixel gets from behind a boundary, background included, and its transmittance there.
fn load_state(boundary: u32, lane: u32) -> vec4f {
    let at = state_at(boundary, lane);
    return bitcast<vec4f>(vec4u(
        pairs[at], pairs[at + RASTER_GROUP], pairs[at + 2u * RASTER_GROUP], pairs[at + 3u * RASTER_GROUP],
    ));
}
