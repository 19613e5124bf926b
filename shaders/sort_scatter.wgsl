// Second kernel of a radix sort pass: moves every key and its value to the output position, and counts the digits of the
// next pass there (no twin; tested in gpu/sort_tests.rs). GROUP keys at a time, a bit mask marks the lanes whose key has a
// digit; the rank of a key is the number of lower bits set in its mask. So the sort is stable, whatever the schedule.
// Workgroup: a block of BLOCK keys. Invocation: every GROUP-th key of the block.

#constants
#include common/groups
#include common/step
#include common/status
#include common/scan
#include common/sort

@group(0) @binding(1) var<storage, read> status: array<Status>; // [ring]
@group(0) @binding(2) var<storage, read> histogram: array<u32>; // common/digit_counts
@group(0) @binding(3) var<storage, read_write> next_histogram: array<atomic<u32>>; // common/digit_counts
@group(0) @binding(4) var<storage, read> keys_in: array<u32>; // [num_keys]
@group(0) @binding(5) var<storage, read> values_in: array<u32>; // [num_keys]
@group(0) @binding(6) var<storage, read_write> keys_out: array<u32>; // [num_keys]
@group(0) @binding(7) var<storage, read_write> values_out: array<u32>; // [num_keys]

// Words of a digit's mask.
const WORDS = GROUP / 32u;
const_assert DIGITS == GROUP;

var<workgroup> masks: array<atomic<u32>, DIGITS * WORDS>; // [DIGITS, WORDS]
var<workgroup> next: array<u32, DIGITS>; // output position of each digit's next key

@compute @workgroup_size(GROUP)
fn sort_scatter(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let block = group_index(id, groups);
    let count = num_keys();
    let num_blocks = blocks_of(count);
    // Keys with lower digits come before. `lane` is a digit; the totals lie behind the counts of all blocks.
    let start = scan_group(lane, histogram[DIGITS * num_blocks + lane]).before;
    var past = 0u;
    if block < num_blocks {
        past = block * BLOCK + min(count - block * BLOCK, BLOCK);
        next[lane] = start + histogram[lane * num_blocks + block];
    }
    for (var word = lane; word < DIGITS * WORDS; word += GROUP) {
        atomicStore(&masks[word], 0u);
    }
    for (var first = 0u; first < BLOCK; first += GROUP) {
        let at = block * BLOCK + first + lane;
        let own = lane / 32u;
        var key = 0u;
        workgroupBarrier();
        if at < past {
            key = keys_in[at];
            atomicOr(&masks[digit_of(key) * WORDS + own], 1u << (lane % 32u));
        }
        workgroupBarrier();
        let digit = digit_of(key);
        var before = 0u;
        var total = 0u;
        if at < past {
            for (var word = 0u; word < WORDS; word += 1u) {
                let lanes = atomicLoad(&masks[digit * WORDS + word]);
                before += countOneBits(lanes & lanes_before(word, lane));
                total += countOneBits(lanes);
            }
            // Below num_keys: the counts are of these keys, and `digit` is below DIGITS.
            move_key(at, key, next[digit] + before, num_blocks);
        }
        workgroupBarrier();
        if at < past {
            atomicStore(&masks[digit * WORDS + own], 0u);
            if before + 1u == total {
                next[digit] += total;
            }
        }
    }
}

// Both places lie below num_keys.
fn move_key(at: u32, key: u32, to: u32, num_blocks: u32) {
    keys_out[to] = key;
    var value = at;
    if sort_pass.identity_values == 0u {
        value = values_in[at];
    }
    values_out[to] = value;
    if sort_pass.counts_next == 1u {
        let digit = (key >> (sort_pass.shift + DIGIT_BITS)) % DIGITS;
        atomicAdd(&next_histogram[digit * num_blocks + to / BLOCK], 1u);
    }
}
