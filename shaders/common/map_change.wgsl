// How a density-control plan changes a map. Mirrors `layout::MapChange`.

struct MapChange {
    // Old splat that the new one is made from.
    source: u32,
    // CHANGE_* along u | that along v << 8, or CHANGE_RESAMPLE
    kind: u32,
    // Row and column where the window begins; on a coarser grid, those of the map. For resampled maps the bits, as f32, of
    // the texture coordinates in the old map of the new centre.
    first_row: i32,
    first_col: i32,
}

// A window of the map's own texel grid.
const CHANGE_SAME = 0u;
// A window of the grid with half the edge.
const CHANGE_FINER = 1u;
// A window of the grid with twice the edge.
const CHANGE_COARSER = 2u;
// Bilinear resampling to another size.
const CHANGE_RESAMPLE = 65536u;
