// Third kernel of a radix sort pass: moves every key and its value to the output position (no twin; tested in
// gpu/sort_tests.rs). A bit mask marks the keys of a block that have a digit; the rank of a key is the number
// of lower bits set in its mask. So the sort is stable, whatever the schedule.
// Workgroup: a block of BLOCK keys. Invocation: every GROUP-th key of the block.

#constants
#include common/groups
#include common/step
#include common/status
#include common/sort

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> histogram: array<u32>; // [DIGITS, num_blocks] starts
@group(0) @binding(3) var<storage, read> keys_in: array<u32>; // [num_keys]
@group(0) @binding(4) var<storage, read> values_in: array<u32>; // [num_keys]
@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>; // [num_keys]
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>; // [num_keys]

// Words of a digit's mask.
const WORDS = BLOCK / 32u;
// Invocations that share the words of a digit, two words each.
const PARTS = GROUP / DIGITS;
const_assert WORDS == 2u * PARTS;

var<workgroup> masks: array<atomic<u32>, DIGITS * WORDS>; // [DIGITS, WORDS]
var<workgroup> part_sums: array<u32, GROUP>; // [DIGITS, PARTS] keys in an invocation's words
var<workgroup> starts: array<u32, DIGITS * WORDS>; // [DIGITS, WORDS] output position of a word's first key

@compute @workgroup_size(GROUP)
fn sort_scatter(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let block = group_index(id, groups);
    let count = num_keys();
    let num_blocks = blocks_of(count);
    let first = block * BLOCK;
    var past = 0u;
    if block < num_blocks {
        past = min(count - first, BLOCK);
    }
    for (var word = lane; word < DIGITS * WORDS; word += GROUP) {
        atomicStore(&masks[word], 0u);
    }
    workgroupBarrier();
    for (var at = lane; at < past; at += GROUP) {
        let digit = digit_of(keys_in[first + at]);
        atomicOr(&masks[digit * WORDS + at / 32u], 1u << (at % 32u));
    }
    workgroupBarrier();
    let digit = lane / PARTS;
    let own = 2u * lane;
    let in_first = countOneBits(atomicLoad(&masks[own]));
    part_sums[lane] = in_first + countOneBits(atomicLoad(&masks[own + 1u]));
    workgroupBarrier();
    var start = 0u;
    if block < num_blocks {
        start = histogram[digit * num_blocks + block];
    }
    for (var part = digit * PARTS; part < lane; part += 1u) {
        start += part_sums[part];
    }
    starts[own] = start;
    starts[own + 1u] = start + in_first;
    workgroupBarrier();
    for (var at = lane; at < past; at += GROUP) {
        let key = keys_in[first + at];
        let word = digit_of(key) * WORDS + at / 32u;
        let lower = atomicLoad(&masks[word]) & ((1u << (at % 32u)) - 1u);
        let to = starts[word] + countOneBits(lower);
        var value = first + at;
        if sort_pass.identity_values == 0u {
            value = values_in[first + at];
        }
        keys_out[to] = key;
        values_out[to] = value;
    }
}
