// Fixed point of the texel gradients: integer sums do not depend on their order. A unit is chosen per splat so
// that even a texel that all pixels of the splat's box share cannot overflow.

// Units per unit of gradient: those for one pixel, over the pixels of the box rounded up to a power of two.
fn texel_units(box_min: u32, box_max: u32) -> f32 {
    let size = vec2u(unpack_px(box_max) - unpack_px(box_min));
    // In integers: two kernels ask, and a float's logarithm need not come out the same in both.
    let bits = 32u - countLeadingZeros(max(size.x * size.y, 1u) - 1u);
    return step.texel_units / f32(1u << min(bits, 31u));
}

// Largest sum of so many pixels of the splat's box in units. All pixels of the box together, however they are
// grouped, come to FIXED_MAX at most and half a unit per summand for rounding: no sum can wrap around. What a
// poisoned gradient has beyond is cut off, and counted.
fn fixed_limit(units: f32, num_pixels: u32) -> f32 {
    return FIXED_MAX * min(1.0, f32(num_pixels) * units / step.texel_units);
}
