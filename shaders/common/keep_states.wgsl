// Stores the states of pixels at the boundaries of segments. Requires `Pixel` and `pairs` of raster_fwd.

#include common/segments

fn store_state(boundary: u32, lane: u32, state: vec4f) {
    let at = state_at(boundary, lane);
    for (var k = 0u; k < 4u; k += 1u) {
        pairs[at + k * RASTER_GROUP] = bitcast<u32>(state[k]);
    }
}

// The backward pass by subgroups takes no windows.
fn store_window(s: Projected, index: u32, origin_px: vec2u) {}

// Stores the state of a pixel that is about to pass pair `index`, if there is a boundary before it; with the colour of the segment
// before it, until `turn_states`.
fn keep_state(pixel: ptr<function, Pixel>, index: u32, tile_first: u32, lane: u32) {
    if step.segment_pairs == 0u || index == tile_first || (*pixel).done {
        return;
    }
    if (index - tile_first) % step.segment_pairs == 0u {
        store_state(index, lane, vec4f((*pixel).segment_rgb, (*pixel).transmittance));
        (*pixel).segment_rgb = vec3f(0.0);
        (*pixel).boundary = index;
    }
}

// Replaces the colours of the segments before the boundaries by all that is behind these. The sums begin with what is farthest: a
// difference from the pixel's colour would have lost the last bits of what is seen through little transmittance.
fn turn_states(pixel: Pixel, tile_first: u32, lane: u32) {
    var rgb = pixel.segment_rgb + pixel.transmittance * step.background;
    for (var boundary = pixel.boundary; boundary > tile_first; boundary -= step.segment_pairs) {
        let there = load_state(boundary, lane);
        store_state(boundary, lane, vec4f(rgb, there.a));
        rgb += there.rgb;
    }
}
