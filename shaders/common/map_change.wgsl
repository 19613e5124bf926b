// What a density-control plan makes of a map. Mirrors `layout`.

struct MapChange {
    // Splat that the new one comes from.
    source: u32,
    // CHANGE_*
    kind: u32,
    // Row and column of the grid that become row and column 0; of resampled maps the bits of the shift, texels of
    // the old map.
    first_row: i32,
    first_col: i32,
}

// A window of the map's own texels, ...
const CHANGE_SAME = 0u;
// ... of a grid of texels of half the edge, ...
const CHANGE_FINER = 1u;
// ... of twice the edge.
const CHANGE_COARSER = 2u;
// Bilinear resampling to another size.
const CHANGE_RESAMPLE = 3u;
