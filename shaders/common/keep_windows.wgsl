// Stores the texel windows of pairs. Requires `pairs` of raster_fwd.

#include common/texel_window

// Stores the window of a pair, in training steps.
fn store_window(s: Projected, index: u32, origin_px: vec2u) {
    if step.step > 0u {
        let window = texel_window(s, origin_px);
        pairs[window_first_at(index)] = pack_px(vec2i(window.first));
        pairs[window_past_at(index)] = pack_px(vec2i(window.past));
    }
}
