// Counts of the keys' digits, per block of BLOCK keys: [DIGITS, num_blocks]. `sort_scan` turns them into prefix sums over
// the blocks, and appends the total of each digit: [DIGITS]. Kernels that emit keys count the lowest digits here; requires
// `histogram` bound.

const_assert DIGITS == GROUP;

var<workgroup> digit_counts: array<atomic<u32>, DIGITS>;

// Called by all lanes, before any of them counts. Lanes lie below GROUP = DIGITS.
fn clear_counts(lane: u32) {
    atomicStore(&digit_counts[lane], 0u);
    workgroupBarrier();
}

fn count_digit(key: u32) {
    atomicAdd(&digit_counts[key % DIGITS], 1u);
}

// Called by all lanes, after all have counted.
fn store_counts(lane: u32, block: u32, num_blocks: u32) {
    workgroupBarrier();
    if block < num_blocks {
        histogram[lane * num_blocks + block] = atomicLoad(&digit_counts[lane]);
    }
}
