// Results of a step that the host reads. Mirrors `layout::Status`. ATOMIC_STATUS: the counters of pairs are atomic.

#if ATOMIC_STATUS
alias StatusCount = atomic<u32>;
#else
alias StatusCount = u32;
#endif

struct Status {
    // 1 once the step has been applied.
    done: u32,
    // Pairs that the view needs; if they exceed the capacity, the step was not applied.
    needed_pairs: u32,
    // Splats that touch a tile.
    visible: u32,
    // Gradients that were not finite or did not fit fixed point.
    faults: u32,
    // Loss terms, weighted.
    l1: f32,
    dssim: f32,
    mse: f32,
    opacity: f32,
    texture: f32,
    // Pixel-splat pairs and global atomics, in the variants that count them.
    evaluated: StatusCount,
    inside: StatusCount,
    blended: StatusCount,
    texel_atomics: StatusCount,
    distortion: f32,
    normal: f32,
    pad: u32,
    // Sums from which the exposure is estimated.
    colour_sums: array<vec4f, 6>,
}
