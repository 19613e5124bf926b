//! Codes of the shapes and positions of splats: standard deviations, texel sizes, rotations, positions. Each
//! quantity has `code_*` and `value_*`; the writer encodes against values as the reader will decode them.

use super::math::{exp2, floor_log2, log2_in_256ths, two_to};
use super::orient::SwingTwist;
use super::steps::{Quantiser, Steps};

/// Largest absolute exponent of a splat.
pub const EXPONENT_MAX: i32 = 8;

/// Coarsest steps of parts of a rotation and of log2 of standard deviations and opacities, whatever the exponent.
const ROTATION_STEP_MAX: f64 = 0.25;
const LOG2_STEP_MAX: f64 = 1.0;

/// Largest sine of half a swing or a twist, below that of 45 degrees by more than the rounding of f32.
const SINE_MAX: f64 = std::f64::consts::FRAC_1_SQRT_2 - 1e-6;

/// Bounds on the anisotropy to which the steps of twists are relative, without and with a map, and from above. Images change
/// with the twist of an untextured splat in proportion to its anisotropy (measured on fox and lego down to 1/20), with that of a
/// textured one at least as if it were 3/8.
const ANISOTROPIES: [f64; 3] = [0.0625, 0.375, 4096.0];

/// Smallest and largest standard deviation.
const SCALES: [f32; 2] = [f32::MIN_POSITIVE, 1e6];

/// What the steps of a splat depend on, as decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// The splat's exponent x.
    pub exponent: i32,
    /// Standard deviations, local units.
    pub scales: [f32; 2],
    /// Texel sizes along u and v; 0 without a map.
    pub texel_sizes: [f32; 2],
}

impl Shape {
    /// Geometric mean of the standard deviations: the length to which steps of positions are relative.
    pub fn mean_scale(&self) -> f64 {
        let [u, v] = self.scales.map(f64::from);
        (u * v).sqrt()
    }

    /// log2 of the length to which steps of positions are proportional, rounded down.
    pub fn log2_position_step(&self) -> i32 {
        floor_log2(self.mean_scale()) + self.exponent
    }

    /// Bits by which the splat's position is coarser than the finest step.
    pub fn position_exponent(&self, quantiser: &Quantiser) -> u32 {
        let grid = &quantiser.grid;
        let exponent = floor_log2(self.mean_scale() / grid.reach) + self.exponent;
        exponent.clamp(0, grid.cell_bits as i32) as u32
    }

    /// How much longer the splat is along one axis than along the other: 0 for equal axes, bounded.
    pub fn anisotropy(&self) -> f64 {
        let [u, v] = self.scales.map(f64::from);
        let least = ANISOTROPIES[usize::from(self.texel_sizes[0] > 0.0)];
        (u / v - v / u).abs().clamp(least, ANISOTROPIES[2])
    }

    /// Steps of swing and twist.
    pub fn rotation_steps(&self, quantiser: &Quantiser) -> [f64; 2] {
        let Steps { tilt, twist, .. } = quantiser.steps;
        let of_splat = two_to(self.exponent);
        [tilt * of_splat, twist * of_splat / self.anisotropy()].map(|step| step.min(ROTATION_STEP_MAX))
    }
}

/// The nearest integer, clamped to i32.
pub fn rounded(x: f64) -> i32 {
    x.round() as i32
}

/// Step of log2 of a splat's standard deviations.
pub fn log2_scale_step(quantiser: &Quantiser, exponent: i32) -> f64 {
    (quantiser.steps.log2_scale * two_to(exponent)).min(LOG2_STEP_MAX)
}

fn log2_opacity_step(quantiser: &Quantiser, exponent: i32) -> f64 {
    (quantiser.steps.log2_opacity * two_to(exponent)).min(LOG2_STEP_MAX)
}

/// Code of a standard deviation.
pub fn code_scale(quantiser: &Quantiser, exponent: i32, scale: f32) -> i32 {
    let above = f64::from(scale).log2() - quantiser.grid.log2_scale;
    rounded(above / log2_scale_step(quantiser, exponent))
}

/// log2 of the standard deviation that a code stands for.
pub fn log2_scale(quantiser: &Quantiser, exponent: i32, code: i32) -> f64 {
    quantiser.grid.log2_scale + f64::from(code) * log2_scale_step(quantiser, exponent)
}

/// The standard deviation with a logarithm.
pub fn value_scale(log2_scale: f64) -> f32 {
    (exp2(log2_scale) as f32).clamp(SCALES[0], SCALES[1])
}

/// Predicted log2 of the geometric mean of a splat's texel sizes, and the step. Maps cover roughly a fixed multiple of the
/// splats' area.
fn texel_size_basis(quantiser: &Quantiser, log2_scales: [f64; 2], [rows, cols]: [u16; 2]) -> (f64, f64) {
    let log2_texels = f64::from(log2_in_256ths(f64::from(rows) * f64::from(cols))) / 256.0;
    let expected = 0.5 * (log2_scales[0] + log2_scales[1] - log2_texels) + quantiser.grid.log2_texel_size;
    let step = quantiser.steps.log2_texel_size * two_to(-floor_log2(f64::from(rows.max(cols))));
    (expected, step)
}

/// Codes of the two texel sizes of a map: of their geometric mean, and of the ratio of the second to the first as a power
/// of two and what is left of it. Maps are refined by factors of two, so that little is left; equal sizes stay equal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TexelSizeCodes {
    /// log2 of the geometric mean against its prediction, steps.
    pub mean: i32,
    /// log2 of the ratio, rounded.
    pub octaves: i32,
    /// The rest of it, steps.
    pub rest: i32,
}

/// Codes of texel sizes; `sides` are not 0.
pub fn code_texel_sizes(
    quantiser: &Quantiser,
    log2_scales: [f64; 2],
    sides: [u16; 2],
    texel_sizes: [f32; 2],
) -> TexelSizeCodes {
    let (expected, step) = texel_size_basis(quantiser, log2_scales, sides);
    let [u, v] = texel_sizes.map(|k| f64::from(k).log2());
    let octaves = rounded(v - u);
    TexelSizeCodes {
        mean: rounded((0.5 * (u + v) - expected) / step),
        octaves,
        rest: rounded((v - u - f64::from(octaves)) / step),
    }
}

/// The texel sizes that codes stand for.
pub fn value_texel_sizes(
    quantiser: &Quantiser,
    log2_scales: [f64; 2],
    sides: [u16; 2],
    codes: TexelSizeCodes,
) -> [f32; 2] {
    let (expected, step) = texel_size_basis(quantiser, log2_scales, sides);
    let mean = expected + f64::from(codes.mean) * step;
    let half = 0.5 * (f64::from(codes.octaves) + f64::from(codes.rest) * step);
    [mean - half, mean + half].map(|log2| (exp2(log2) as f32).clamp(f32::MIN_POSITIVE, f32::MAX))
}

/// Codes of a rotation wxyz in the orientation of files: two of the swing, one of the twist. What they stand for is in that orientation
/// too, if only just: rounded again, it would otherwise be turned, and its map be rounded in another order.
pub fn code_rotation(quantiser: &Quantiser, shape: &Shape, q: [f32; 4]) -> [i32; 3] {
    let SwingTwist { swing: [x, y], twist } = SwingTwist::of(q.map(f64::from));
    let [tilt_step, twist_step] = shape.rotation_steps(quantiser);
    let mut codes = [x / tilt_step, y / tilt_step, twist / twist_step].map(rounded);
    let length = |codes: [i32; 3]| f64::from(codes[0]).hypot(codes[1].into()) * tilt_step;
    // Rounding leads out by a step of each number at most.
    for _ in 0..2 {
        if length(codes) > SINE_MAX {
            let longer = usize::from(codes[1].abs() > codes[0].abs());
            codes[longer] -= codes[longer].signum();
        }
    }
    if f64::from(codes[2].abs()) * twist_step > SINE_MAX {
        codes[2] -= codes[2].signum();
    }
    codes
}

/// A unit quaternion wxyz.
pub fn value_rotation(quantiser: &Quantiser, shape: &Shape, codes: [i32; 3]) -> [f32; 4] {
    let [tilt_step, twist_step] = shape.rotation_steps(quantiser);
    let [x, y] = [codes[0], codes[1]].map(|code| f64::from(code) * tilt_step);
    let squares = x * x + y * y;
    let swing = if squares > 1.0 { [x, y].map(|part| part / squares.sqrt()) } else { [x, y] };
    let twist = (f64::from(codes[2]) * twist_step).clamp(-1.0, 1.0);
    SwingTwist { swing, twist }.quaternion().map(|c| c as f32)
}

/// A position in finest steps from the corner of the cube, clamped to it. `[3]`
pub fn fine_position(quantiser: &Quantiser, position: [f32; 3]) -> [u32; 3] {
    let grid = &quantiser.grid;
    let step = quantiser.steps.position * grid.reach;
    let last = ((1_u64 << grid.bits) - 1) as f64;
    std::array::from_fn(|i| {
        ((f64::from(position[i]) - grid.origin[i]) / step).floor().clamp(0.0, last) as u32
    })
}

/// Centre of the cube of `2^exponent` finest steps that begins at `corner`.
pub fn value_position(quantiser: &Quantiser, corner: [u32; 3], exponent: u32) -> [f32; 3] {
    let grid = &quantiser.grid;
    let step = quantiser.steps.position * grid.reach;
    let half = 0.5 * two_to(exponent as i32);
    std::array::from_fn(|i| (grid.origin[i] + (f64::from(corner[i]) + half) * step) as f32)
}

/// Code of an opacity: halvings from 1, in steps.
pub fn code_opacity(quantiser: &Quantiser, exponent: i32, opacity: f32) -> u32 {
    rounded(-f64::from(opacity).log2() / log2_opacity_step(quantiser, exponent)).max(0) as u32
}

/// The opacity that a code stands for.
pub fn value_opacity(quantiser: &Quantiser, exponent: i32, code: u32) -> f32 {
    let log2 = -(f64::from(code) * log2_opacity_step(quantiser, exponent));
    (exp2(log2) as f32).clamp(f32::MIN_POSITIVE, 1.0)
}
