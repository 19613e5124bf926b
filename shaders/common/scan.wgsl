// Prefix sums over the invocations (lanes) of a workgroup.

var<workgroup> scan_sums: array<u32, GROUP>; // inclusive sums up to each lane

// Saturates: the result does not depend on the order of summation, and an overflow stays visible.
fn add_saturating(a: u32, b: u32) -> u32 {
    let sum = a + b;
    return select(sum, 0xffffffffu, sum < a);
}

struct Scan {
    // Sum of the lanes before this one.
    before: u32,
    total: u32,
}

// Must be called in uniform control flow.
fn scan_group(lane: u32, value: u32) -> Scan {
    var sum = value;
    // Other invocations may still be reading the sums of an earlier call.
    workgroupBarrier();
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

// Neighbouring elements of a block that each lane sums on its own.
const LANE_ELEMENTS = BLOCK / GROUP;
