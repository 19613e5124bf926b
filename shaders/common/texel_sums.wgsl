// Adds the texel gradients of a splat and of the samples of SUM_LANES lanes to memory. Requires what texel_grad and lane_sums do.

// Windows of more texels are scattered, each tap by an atomic: texels of less than two or three pixels.
const GATHERED_TEXELS_MAX = 20u;
// Texels summed at a time.
const TEXELS_AT_A_TIME = 5u;

// For all lanes of a subgroup. Returns the faults of the lane, or with COUNT its atomics.
fn add_texels(s: Projected, taps: Taps, by_colour: vec3f, blended: bool, subgroup_lane: u32) -> u32 {
    let touches = blended && taps.inside;
    let size = vec2i(i32(map_rows(s.map_size)), i32(map_cols(s.map_size)));
    let first = subgroupMin(select(size, max(taps.first, vec2i(0)), touches));
    let past = subgroupMax(select(vec2i(0), min(taps.past, size), touches));
    let extent = vec2u(max(past - first, vec2i(0)));
    let num_texels = extent.x * extent.y;
    if num_texels > GATHERED_TEXELS_MAX {
        if touches {
            return scatter(s, taps, by_colour);
        }
        return 0u;
    }
    let touching = extractBits(subgroupBallot(touches).x, subgroup_lane / SUM_LANES * SUM_LANES, SUM_LANES);
    let units = texel_units(s.box_min, s.box_max);
    let limit = fixed_limit(units, countOneBits(touching));
    let by_texel = by_colour * per_footprint(s);
    var faults = 0u;
    var texel = first;
    for (var begin = 0u; begin < num_texels; begin += TEXELS_AT_A_TIME) {
        var by = array<vec3f, TEXELS_AT_A_TIME>();
        for (var k = 0u; k < TEXELS_AT_A_TIME; k += 1u) {
            let length = overlap(taps.coordinate - vec2f(texel), taps.reach);
            by[k] = select(vec3f(0.0), by_texel * (length.x * length.y), touches);
            texel.y += 1;
            if texel.y == past.y {
                texel = vec2i(texel.x + 1, first.y);
            }
        }
        let values = mat4x4f(
            vec4f(by[0], by[1].x), vec4f(by[1].yz, by[2].xy), vec4f(by[2].z, by[3]), vec4f(by[4], 0.0),
        );
        let sums = lane_sums(values, subgroup_lane);
        for (var k = 0u; k < SUMS_PER_LANE; k += 1u) {
            let sum = subgroup_lane % SUM_LANES * SUMS_PER_LANE + k;
            let at = begin + sum / 3u;
            // The last texels may be behind the window.
            if sum < 3u * TEXELS_AT_A_TIME && at < num_texels {
                // Between `first` and `past`, within the map.
                let place = vec2u(first) + vec2u(at / extent.y, at % extent.y);
                let texel_at = s.map_offset_texels + place.x * u32(size.y) + place.y;
                faults += add_fixed(3u * texel_at + sum % 3u, sums[k], units, limit);
            }
        }
    }
    return faults;
}
