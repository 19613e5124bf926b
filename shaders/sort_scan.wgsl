// Second kernel of a radix sort pass: turns the counts into the output position of the first key of each digit
// and block (no twin; tested in gpu/sort_tests.rs).
// One workgroup. Invocation: LANE_ELEMENTS neighbouring counts at a time.

#constants
#include common/groups
#include common/step
#include common/status
#include common/scan
#include common/sort

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read_write> histogram: array<u32>; // [DIGITS, num_blocks]

var<workgroup> num_entries: u32;

@compute @workgroup_size(GROUP)
fn sort_scan(@builtin(local_invocation_index) lane: u32) {
    if lane == 0u {
        num_entries = DIGITS * blocks_of(num_keys());
    }
    let count = workgroupUniformLoad(&num_entries);
    var total = 0u;
    for (var block = 0u; block < count; block += BLOCK) {
        let first = block + lane * LANE_ELEMENTS;
        let past = min(first + LANE_ELEMENTS, count);
        var sum = 0u;
        for (var i = first; i < past; i += 1u) {
            sum += histogram[i];
        }
        let scan = scan_group(lane, sum);
        sum = total + scan.before;
        for (var i = first; i < past; i += 1u) {
            let here = histogram[i];
            histogram[i] = sum;
            sum += here;
        }
        total += scan.total;
    }
}
