// Sums over a block of GROUP splats, which `finish_blocks` writes and `finish` reads. The host never reads them.

struct SplatSums {
    // Weighted opacity and texture terms.
    opacity: f32,
    texture: f32,
    faults: u32,
}
