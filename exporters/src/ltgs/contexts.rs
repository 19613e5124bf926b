//! What a reader knows about a number before it reads it: contexts of the streams of a lossy file, all from codes that come
//! before. `schema/ltgs.md`, section 4.3.

use super::integers::zigzag;
use super::math::log2_in_256ths;
use super::numbers::length;
use super::shape::{EXPONENT_MAX, Shape, log2_scale_step};
use super::steps::Quantiser;

/// Sides of maps from which they are not told apart, where one side is a context, and where both are.
const SIDE_MAX: u16 = 12;
const SIDES_MAX: u16 = 6;

/// Octaves of standard deviations below and above the grid's that are told apart.
const OCTAVES: (i32, i32) = (-20, 19);

/// Classes of twist steps: quarters of octaves below 1.
const TWIST_CLASS_MAX: i32 = 127;

/// One more than the largest length of a number.
const LENGTHS: u32 = 33;

/// Length of a signed code.
pub fn size(code: i32) -> u32 {
    length(zigzag(code))
}

/// A splat's exponent.
pub fn of_exponent(exponent: i32) -> u32 {
    (exponent + EXPONENT_MAX) as u32
}

/// A splat's exponent and the length of another code of the splat.
pub fn of_exponent_and(exponent: i32, code: i32) -> u32 {
    LENGTHS * of_exponent(exponent) + size(code)
}

/// A side of a map.
pub fn of_side(side: u16) -> u32 {
    side.min(SIDE_MAX).into()
}

/// The step of a splat's twist.
pub fn of_twist(quantiser: &Quantiser, shape: &Shape) -> u32 {
    let [_, twist_step] = shape.rotation_steps(quantiser);
    (-log2_in_256ths(twist_step)).div_euclid(64).clamp(0, TWIST_CLASS_MAX) as u32
}

/// Both sides of a map.
pub fn of_sides(sides: [u16; 2]) -> u32 {
    let [rows, cols] = sides.map(|side| u32::from(side.min(SIDES_MAX)));
    u32::from(SIDES_MAX + 1) * rows + cols
}

/// A splat's exponent and the code of the standard deviation of its longer axis.
pub fn of_scale(quantiser: &Quantiser, exponent: i32, scale: i32) -> u32 {
    let octaves = (f64::from(scale) * log2_scale_step(quantiser, exponent)).floor();
    let octave = (octaves as i32).clamp(OCTAVES.0, OCTAVES.1) - OCTAVES.0;
    (OCTAVES.1 - OCTAVES.0 + 1) as u32 * of_exponent(exponent) + octave as u32
}
