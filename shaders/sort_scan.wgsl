// First kernel of a radix sort pass: turns the counts of each digit into the number of its keys in earlier blocks, and
// appends their total (no twin; tested in gpu/sort_tests.rs). Clears the counts of the next pass.
// Workgroup: a digit, or all of a few keys (`scan_groups`). Invocation: LANE_ELEMENTS neighbouring counts at a time, or a digit.

#constants
#include common/groups
#include common/step
#include common/status
#include common/scan
#include common/sort

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read_write> histogram: array<u32>; // common/digit_counts
@group(0) @binding(3) var<storage, read_write> next_histogram: array<u32>; // common/digit_counts

const_assert DIGITS == GROUP;

// Turns some counts of a digit into sums, from the sum of those before; returns the sum of all.
fn scan_counts(row: u32, first: u32, past: u32, before: u32) -> u32 {
    var sum = before;
    for (var i = row + first; i < row + past; i += 1u) {
        let here = histogram[i];
        histogram[i] = sum;
        sum += here;
        if sort_pass.counts_next == 1u {
            next_histogram[i] = 0u;
        }
    }
    return sum;
}

@compute @workgroup_size(GROUP)
fn sort_scan(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let num_blocks = blocks_of(num_keys());
    let totals = DIGITS * num_blocks;
    if scan_groups(num_keys()) == 1u {
        histogram[totals + lane] = scan_counts(lane * num_blocks, 0u, num_blocks, 0u);
        return;
    }
    let digit = group_index(id, groups);
    let row = digit * num_blocks;
    var total = 0u;
    for (var block = 0u; block < num_blocks; block += BLOCK) {
        let first = min(block + lane * LANE_ELEMENTS, num_blocks);
        let past = min(first + LANE_ELEMENTS, num_blocks);
        var sum = 0u;
        for (var i = first; i < past; i += 1u) {
            sum += histogram[row + i];
        }
        let scan = scan_group(lane, sum);
        scan_counts(row, first, past, total + scan.before);
        total += scan.total;
    }
    if lane == 0u {
        histogram[totals + digit] = total;
    }
}
