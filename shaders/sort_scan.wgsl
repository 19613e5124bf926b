// Radix sort, second of a pass: where each block's keys of each digit start in the output. One workgroup.

#constants
#include common/groups
#include common/step
#include common/status
#include common/scan
#include common/sort

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read_write> histogram: array<u32>; // [DIGITS, num_blocks]

@compute @workgroup_size(GROUP)
fn sort_scan(@builtin(local_invocation_index) lane: u32) {
    let run = lane_run(lane, DIGITS * blocks_of(num_keys()));
    var sum = 0u;
    for (var i = run.x; i < run.y; i += 1u) {
        sum += histogram[i];
    }
    sum = scan_group(lane, sum).before;
    for (var i = run.x; i < run.y; i += 1u) {
        let here = histogram[i];
        histogram[i] = sum;
        sum += here;
    }
}
