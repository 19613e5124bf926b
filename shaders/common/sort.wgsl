// One pass of the stable radix sort, which runs from the lowest digit to the highest. Mirrors `layout::SortPass`.
// Requires `status` bound.

struct SortPass {
    // Bits below the digit.
    shift: u32,
    // 1: one key per pair, 0: one per visible splat.
    counts_pairs: u32,
    // 1: the values are the indices of the keys, and are not read.
    identity_values: u32,
    // 1: another pass follows, whose digits are counted on the way.
    counts_next: u32,
}

@group(0) @binding(15) var<uniform> sort_pass: SortPass;

fn num_keys() -> u32 {
    if sort_pass.counts_pairs == 1u {
        return status[step.status_slot].needed_pairs;
    }
    return status[step.status_slot].visible;
}

fn digit_of(key: u32) -> u32 {
    return (key >> sort_pass.shift) % DIGITS;
}
