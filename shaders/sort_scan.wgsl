// First kernel of a radix sort pass: turns the counts of each digit into the number of its keys in earlier blocks, and
// appends their total (no twin; tested in gpu/sort_tests.rs). Clears the counts of the next pass.
// Workgroup: a digit. Invocation: LANE_ELEMENTS neighbouring counts at a time.

#constants
#include common/groups
#include common/step
#include common/status
#include common/scan
#include common/sort

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read_write> histogram: array<u32>; // common/digit_counts
@group(0) @binding(3) var<storage, read_write> next_histogram: array<u32>; // common/digit_counts

@compute @workgroup_size(GROUP)
fn sort_scan(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let digit = group_index(id, groups);
    let num_blocks = blocks_of(num_keys());
    let row = digit * num_blocks;
    var total = 0u;
    for (var block = 0u; block < num_blocks; block += BLOCK) {
        let first = block + lane * LANE_ELEMENTS;
        let past = min(first + LANE_ELEMENTS, num_blocks);
        var sum = 0u;
        for (var i = first; i < past; i += 1u) {
            sum += histogram[row + i];
        }
        var scan = Scan(0u, sum);
        // Otherwise the first lane has all counts (measured on lavapipe, 2,000 splats: 18 ms a step instead of 39).
        if num_blocks > LANE_ELEMENTS {
            scan = scan_group(lane, sum);
        }
        sum = total + scan.before;
        for (var i = first; i < past; i += 1u) {
            let here = histogram[row + i];
            histogram[row + i] = sum;
            sum += here;
            if sort_pass.counts_next == 1u {
                next_histogram[row + i] = 0u;
            }
        }
        total += scan.total;
    }
    if lane == 0u {
        histogram[DIGITS * num_blocks + digit] = total;
    }
}
