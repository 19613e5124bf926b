// One pass of the stable radix sort, from the low digit to the high one. Mirrors `layout::SortPass`. Kernels
// that include this bind `status`.

struct SortPass {
    // Bits below the digit.
    shift: u32,
    // 1: as many keys as pairs, 0: as many as splats.
    counts_pairs: u32,
    // 1: values are the indices of their keys and are not read.
    identity_values: u32,
    pad: u32,
}

@group(0) @binding(15) var<uniform> sort_pass: SortPass;

fn num_keys() -> u32 {
    if sort_pass.counts_pairs == 1u {
        return status[step.status_slot].needed_pairs;
    }
    return step.num_splats;
}

fn digit_of(key: u32) -> u32 {
    return (key >> sort_pass.shift) & (DIGITS - 1u);
}
