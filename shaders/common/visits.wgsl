// Which patches of a tile the splats of a batch may touch. A patch is 8 x 4 pixels, those of 32 consecutive invocations
// (`pixel_in_tile`); its invocations pass over the splats whose boxes miss it. Requires NUM_VISITS.

const PATCH_LANES = 32u;
const PATCH_PX = vec2u(8u, 4u);
const NUM_PATCHES = RASTER_GROUP / PATCH_LANES;

// Bit k of a word: splat k of 32 touches the patch. [NUM_VISITS / NUM_PATCHES, NUM_PATCHES]
var<workgroup> visits: array<atomic<u32>, NUM_VISITS>;

// Marks the patches that a box touches, in NUM_PATCHES words from `first` on, for splat k < 32.
fn mark_visits(first: u32, k: u32, box_min: u32, box_max: u32, origin_px: vec2u) {
    let low = vec2u(box_min & 0xffffu, box_min >> 16u);
    let high = vec2u(box_max & 0xffffu, box_max >> 16u);
    for (var j = 0u; j < NUM_PATCHES; j += 1u) {
        // Each splat begins with another patch, so that the atomics rarely meet.
        let at = (j + k) % NUM_PATCHES;
        let patch_px = origin_px + pixel_in_tile(at * PATCH_LANES);
        if all(low < patch_px + PATCH_PX) && all(high > patch_px) {
            atomicOr(&visits[first + at], 1u << k);
        }
    }
}
