// First slot of each block of visible splats (no twin; tested in gpu/tile_list_tests.rs).
// One workgroup. Invocation: LANE_ELEMENTS neighbouring blocks at a time.

#constants
#include common/groups
#include common/step
#include common/status
#include common/scan

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read_write> block_sums: array<u32>; // [num_blocks]

@compute @workgroup_size(GROUP)
fn prefix_sums(@builtin(local_invocation_index) lane: u32) {
    let count = blocks_of(status[step.status_slot].visible);
    var total = 0u;
    for (var block = 0u; block < count; block += BLOCK) {
        let first = block + lane * LANE_ELEMENTS;
        let past = min(first + LANE_ELEMENTS, count);
        var sum = 0u;
        for (var i = first; i < past; i += 1u) {
            sum += block_sums[i];
        }
        let scan = scan_group(lane, sum);
        sum = total + scan.before;
        for (var i = first; i < past; i += 1u) {
            let here = block_sums[i];
            block_sums[i] = sum;
            sum += here;
        }
        total += scan.total;
    }
}
