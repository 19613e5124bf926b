//! Codes of the shapes and positions of splats: standard deviations, texel sizes, rotations, positions. Each
//! quantity has `code_*` and `value_*`; the writer encodes against values as the reader will decode them.

use super::math::{exp2, floor_log2, log2_in_256ths, two_to};
use super::steps::Quantiser;

/// Largest absolute exponent of a splat.
pub const EXPONENT_MAX: i32 = 8;

/// Coarsest steps of quaternion components and of log2 standard deviations, whatever the exponent.
const ROTATION_STEP_MAX: f64 = 0.25;
const LOG2_SCALE_STEP_MAX: f64 = 1.0;

/// Smallest and largest standard deviation.
const SCALES: [f32; 2] = [f32::MIN_POSITIVE, 1e6];

/// Bound on how much finer the steps of rotations get for long splats, as a power of two.
const LENGTH_MAX: i32 = 12;

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
    /// The length to which steps of positions are relative: the smaller standard deviation, or two texels along the finer
    /// axis if that is less.
    fn reach(&self) -> f64 {
        let smaller = f64::from(self.scales[0].min(self.scales[1]));
        let texels = 2.0 * f64::from(self.texel_sizes[0].min(self.texel_sizes[1]));
        if texels > 0.0 && texels < smaller { texels } else { smaller }
    }

    /// log2 of the length to which steps of positions are proportional, rounded down.
    pub fn log2_position_step(&self) -> i32 {
        floor_log2(self.reach()) + self.exponent
    }

    /// Bits by which the splat's position is coarser than the finest step.
    pub fn position_exponent(&self, quantiser: &Quantiser) -> u32 {
        let grid = &quantiser.grid;
        let exponent = floor_log2(self.reach() / grid.reach) + self.exponent;
        exponent.clamp(0, grid.cell_bits as i32) as u32
    }

    fn rotation_step(&self, quantiser: &Quantiser) -> f64 {
        let longer = f64::from(self.scales[0].max(self.scales[1]));
        let length = floor_log2(longer / self.reach()).clamp(0, LENGTH_MAX);
        (quantiser.steps.rotation * two_to(self.exponent - length)).min(ROTATION_STEP_MAX)
    }

    /// Exponent of the steps of texels: that of the splat, plus one for each halving of the texel size relative to the
    /// standard deviations.
    pub fn texel_exponent(&self) -> i32 {
        let [u, v] = self.scales.map(f64::from);
        let [texel_u, texel_v] = self.texel_sizes.map(f64::from);
        let fineness = floor_log2(u * v / (texel_u * texel_v)).clamp(-16, 16);
        self.exponent + (fineness >> 1) - 1
    }
}

/// The nearest integer, clamped to i32.
pub fn rounded(x: f64) -> i32 {
    x.round() as i32
}

fn log2_scale_step(quantiser: &Quantiser, exponent: i32) -> f64 {
    (quantiser.steps.log2_scale * two_to(exponent)).min(LOG2_SCALE_STEP_MAX)
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

/// Index of the largest component, and codes of the other three in order.
pub fn code_rotation(quantiser: &Quantiser, shape: &Shape, q: [f32; 4]) -> (u32, [i32; 3]) {
    let mut largest = 0;
    for i in 1..4 {
        if q[i].abs() > q[largest].abs() {
            largest = i;
        }
    }
    let sign = if q[largest] < 0.0 { -1.0 } else { 1.0 };
    let step = shape.rotation_step(quantiser);
    let codes = others(largest).map(|i| rounded(sign * f64::from(q[i]) / step));
    (largest as u32, codes)
}

/// A unit quaternion wxyz whose largest component is positive. `largest` < 4.
pub fn value_rotation(quantiser: &Quantiser, shape: &Shape, largest: u32, codes: [i32; 3]) -> [f32; 4] {
    let step = shape.rotation_step(quantiser);
    let mut parts = codes.map(|code| f64::from(code) * step);
    let squares = parts[0] * parts[0] + parts[1] * parts[1] + parts[2] * parts[2];
    let rest = if squares > 1.0 {
        let norm = squares.sqrt();
        parts = parts.map(|p| p / norm);
        0.0
    } else {
        (1.0 - squares).sqrt()
    };
    let largest = largest as usize & 3;
    let mut q = [rest as f32; 4];
    for (i, part) in others(largest).into_iter().zip(parts) {
        q[i] = part as f32;
    }
    q
}

/// Indices of the other components, ascending.
fn others(largest: usize) -> [usize; 3] {
    std::array::from_fn(|i| if i < largest { i } else { i + 1 })
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

/// Code of an opacity, at least 1.
pub fn code_opacity(quantiser: &Quantiser, opacity: f32) -> u32 {
    rounded(f64::from(opacity) / quantiser.steps.opacity).max(1) as u32
}

/// The opacity that a code stands for; 0 counts as 1.
pub fn value_opacity(quantiser: &Quantiser, code: u32) -> f32 {
    (f64::from(code.max(1)) * quantiser.steps.opacity).min(1.0) as f32
}
