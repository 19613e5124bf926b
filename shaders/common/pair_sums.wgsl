// Places of the sums of a pair, which raster_bwd writes and sum_pairs adds up. The strides mirror
// `layout::PAIR_SUMS` and its variants.

// Derivatives by the first and second coordinate on the surfel and by the denominator: the sum, times dx, times dy.
const SUM_U = 0u;
const SUM_V = 3u;
const SUM_D = 6u;
// By the exponent, times products of the coordinates: aa, ab, bb.
const SUM_EXPONENT = 9u;
// By the opacity.
const SUM_FALLOFF = 12u;
const SUM_RGB = 13u;
// Faults of a whole tile, in its first pair that is summed; 0 in others.
const SUM_FAULTS = 16u;
const PAIR_SUMS = 17u;
// Window statistics: pixels, blending weight, blending weight times loss.
const SUM_STATISTICS = 17u;
const PAIR_SUMS_STATISTICS = 20u;
// By the centre's depth, times minus that depth, and by the normal that faces the camera.
const SUM_DEPTH = 20u;
const SUM_NORMAL = 21u;
const PAIR_SUMS_GEOMETRY = 24u;
