// Prefix sums over the lanes of a workgroup.

var<workgroup> scan_sums: array<u32, GROUP>; // inclusive sums up to each lane

// What does not fit stays at the largest number: sums of any order agree, and an overflow cannot hide.
fn add_saturating(a: u32, b: u32) -> u32 {
    let sum = a + b;
    return select(sum, 0xffffffffu, sum < a);
}

struct Scan {
    // Sum of the lanes before this one.
    before: u32,
    total: u32,
}

// To be called by all lanes, once per kernel (the sums are not guarded against a second call).
fn scan_group(lane: u32, value: u32) -> Scan {
    var sum = value;
    scan_sums[lane] = sum;
    workgroupBarrier();
    for (var reach = 1u; reach < GROUP; reach *= 2u) {
        var earlier = 0u;
        if lane >= reach {
            earlier = scan_sums[lane - reach];
        }
        workgroupBarrier();
        sum = add_saturating(earlier, sum);
        scan_sums[lane] = sum;
        workgroupBarrier();
    }
    var before = 0u;
    if lane > 0u {
        before = scan_sums[lane - 1u];
    }
    return Scan(before, scan_sums[GROUP - 1u]);
}

// A lane's share of `count` elements: a run of neighbours, so that one scan of the runs' sums does for any
// count. First and past.
fn lane_run(lane: u32, count: u32) -> vec2u {
    let each = (count + (GROUP - 1u)) / GROUP;
    return min(vec2u(lane, lane + 1u) * each, vec2u(count));
}
