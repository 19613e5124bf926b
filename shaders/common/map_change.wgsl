// How a density-control plan changes a map. Mirrors `layout::MapChange`.

struct MapChange {
    // Old splat that the new one is made from.
    source: u32,
    // CHANGE_*
    kind: u32,
    // Row and column of the grid that become row and column 0. For resampled maps, the bits of the shift of the
    // centre as f32, in texels of the old map.
    first_row: i32,
    first_col: i32,
}

// A window of the map's own texel grid.
const CHANGE_SAME = 0u;
// A window of the grid with half the texel size.
const CHANGE_FINER = 1u;
// A window of the grid with twice the texel size.
const CHANGE_COARSER = 2u;
// Bilinear resampling to another size.
const CHANGE_RESAMPLE = 3u;
