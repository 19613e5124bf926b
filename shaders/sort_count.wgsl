// First kernel of a radix sort pass: counts how often each digit occurs in each block of BLOCK keys (no twin;
// tested in gpu/sort_tests.rs).
// Workgroup: a block. Invocation: every GROUP-th key of the block.

#constants
#include common/groups
#include common/step
#include common/status
#include common/sort

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> keys_in: array<u32>; // [num_keys]
@group(0) @binding(3) var<storage, read_write> histogram: array<u32>; // [DIGITS, num_blocks]

// Each digit has several counters, to reduce contention.
const COLUMNS = GROUP / DIGITS;

var<workgroup> counts: array<atomic<u32>, GROUP>; // [DIGITS, COLUMNS]

@compute @workgroup_size(GROUP)
fn sort_count(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let block = group_index(id, groups);
    let count = num_keys();
    let num_blocks = blocks_of(count);
    atomicStore(&counts[lane], 0u);
    workgroupBarrier();
    if block < num_blocks {
        let past = min(count - block * BLOCK, BLOCK);
        for (var at = lane; at < past; at += GROUP) {
            let digit = digit_of(keys_in[block * BLOCK + at]);
            atomicAdd(&counts[digit * COLUMNS + lane % COLUMNS], 1u);
        }
    }
    workgroupBarrier();
    if lane < DIGITS && block < num_blocks {
        var sum = 0u;
        for (var column = 0u; column < COLUMNS; column += 1u) {
            sum += atomicLoad(&counts[lane * COLUMNS + column]);
        }
        histogram[lane * num_blocks + block] = sum;
    }
}
