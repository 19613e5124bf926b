// Sums over SUM_LANES invocations of a subgroup by a butterfly, always in the same order. Pairs of lanes exchange the halves
// of their values that the other one goes on with: 16 values of 32 lanes take 16 exchanges, not 80.
// LANES_4, LANES_8, LANES_16: the number of lanes, at most the subgroup's; 32 without.

#if LANES_4
const SUM_LANES = 4u;
#else
#if LANES_8
const SUM_LANES = 8u;
#else
#if LANES_16
const SUM_LANES = 16u;
#else
const SUM_LANES = 32u;
#endif
#endif
#endif

const MAX_LANE_SUMS = 16u;
// Lanes that end with sums, and how many each.
const SUMMING_LANES = min(SUM_LANES, MAX_LANE_SUMS);
const SUMS_PER_LANE = MAX_LANE_SUMS / SUMMING_LANES;

// Keeps one of two values and adds the other lane's.
fn exchange(kept_by_low: vec4f, kept_by_high: vec4f, subgroup_lane: u32, bit: u32) -> vec4f {
    let is_high = (subgroup_lane & bit) != 0u;
    return select(kept_by_low, kept_by_high, is_high)
        + subgroupShuffleXor(select(kept_by_high, kept_by_low, is_high), bit);
}

// The sums of SUMS_PER_LANE of the values, from `SUMS_PER_LANE * (subgroup_lane % SUM_LANES)` on, in the
// first SUMMING_LANES of the lanes.
fn lane_sums(values: mat4x4f, subgroup_lane: u32) -> vec4f {
    let first = exchange(values[0], values[2], subgroup_lane, SUMMING_LANES / 2u);
    let second = exchange(values[1], values[3], subgroup_lane, SUMMING_LANES / 2u);
    let four = exchange(first, second, subgroup_lane, SUMMING_LANES / 4u);
    if SUM_LANES < 8u {
        return four;
    }
    let is_third = (subgroup_lane & (SUMMING_LANES / 8u)) != 0u;
    let two = select(four.xy, four.zw, is_third)
        + subgroupShuffleXor(select(four.zw, four.xy, is_third), SUMMING_LANES / 8u);
    if SUM_LANES < 16u {
        return vec4f(two, 0.0, 0.0);
    }
    let is_odd = (subgroup_lane & 1u) != 0u;
    var one = select(two.x, two.y, is_odd) + subgroupShuffleXor(select(two.y, two.x, is_odd), 1u);
    if SUM_LANES == 32u {
        one += subgroupShuffleXor(one, 16u);
    }
    return vec4f(one, 0.0, 0.0, 0.0);
}
