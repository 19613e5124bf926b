// What a step tells the host. Mirrors `layout::Status`; `STATUS_COUNT` is what its counters are made of.

#if ATOMIC_STATUS
alias StatusCount = atomic<u32>;
#else
alias StatusCount = u32;
#endif

struct Status {
    // 1 once the step has been applied.
    done: u32,
    // Pairs that the view needs; more than the capacity means that nothing was applied.
    needed_pairs: u32,
    visible: u32,
    faults: u32,
    l1: f32,
    dssim: f32,
    mse: f32,
    opacity: f32,
    texture: f32,
    // Pixel-splat pairs and global atomics, where they are counted.
    evaluated: StatusCount,
    inside: StatusCount,
    blended: StatusCount,
    texel_atomics: StatusCount,
    distortion: f32,
    normal: f32,
    pad: u32,
}
