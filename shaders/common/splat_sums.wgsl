// What `finish_blocks` leaves of a block of GROUP splats for `finish`. The host never reads it.

struct SplatSums {
    // Opacity and texture terms, weighted.
    opacity: f32,
    texture: f32,
    // Splats that touch a tile.
    visible: u32,
    faults: u32,
}
