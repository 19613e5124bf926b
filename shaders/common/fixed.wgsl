// Fixed-point texel gradients: integer sums do not depend on their order. The unit of each splat is chosen so
// that a texel cannot overflow even if all pixels of the splat's box contribute to it.

// Fixed-point units per unit of gradient: `step.texel_units` divided by the number of pixels of the box,
// rounded up to a power of two.
fn texel_units(box_min: u32, box_max: u32) -> f32 {
    let size = vec2u(unpack_px(box_max) - unpack_px(box_min));
    // In integers: two kernels compute this, and a floating-point logarithm may round differently in each.
    let bits = 32u - countLeadingZeros(max(size.x * size.y, 1u) - 1u);
    return step.texel_units / f32(1u << min(bits, 31u));
}

// Largest gradient, in units, that `num_pixels` pixels of the splat's box may add to a texel. However the
// pixels of the box are grouped, their limits add up to at most FIXED_MAX, plus half a unit of rounding per
// summand, so that no sum wraps around. Poisoned gradients beyond the limit are clamped and counted.
fn fixed_limit(units: f32, num_pixels: u32) -> f32 {
    return FIXED_MAX * min(1.0, f32(num_pixels) * units / step.texel_units);
}
