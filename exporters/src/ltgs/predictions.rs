//! Predictions of codes from the splats before in the chunk, which lie near in space. Sums run in the order of splats, so that
//! every reader gets the same bits.

use super::math::two_to;
use super::shape::log2_scale_step;
use super::splats::SplatCodes;
use super::steps::Quantiser;
use crate::num_sh_coefficients;

/// Splats before that predict a standard deviation. Measured: 16 are as good.
const SCALES_BEFORE: usize = 8;

/// Splats before that predict a colour, weighted by distance to the power of -4. Measured: 64 and all powers from -1 to -4 are
/// within 2 % of the bytes.
const COLOURS_BEFORE: usize = 32;

/// Predicted codes stay in this range.
const CODE_MAX: f64 = (1 << 30) as f64;

/// The integer nearest to a predicted code.
fn code(predicted: f64) -> i32 {
    (predicted + 0.5).floor().clamp(-CODE_MAX, CODE_MAX) as i32
}

impl SplatCodes {
    /// The code of a splat's standard deviation along u: the mean of its logarithms of the splats before.
    pub fn predicted_scale(&self, quantiser: &Quantiser, splat: usize) -> i32 {
        let before = splat.saturating_sub(SCALES_BEFORE)..splat;
        if before.is_empty() {
            return 0;
        }
        let log2 = |j: usize| f64::from(self.scales[j][0]) * log2_scale_step(quantiser, self.exponents[j]);
        let mean = before.clone().map(log2).fold(0.0, |sum, x| sum + x) / before.len() as f64;
        code(mean / log2_scale_step(quantiser, self.exponents[splat]))
    }

    /// The codes of a splat's SH of degree 0: the mean of the splats before, the nearest ones most. `corners`: positions as
    /// decoded, in finest steps.
    pub fn predicted_colour(&self, corners: &[[u32; 3]], sh_degree: u32, splat: usize) -> [i32; 3] {
        let width = 3 * num_sh_coefficients(sh_degree);
        let (mut sums, mut total) = ([0.0; 3], 0.0);
        for j in splat.saturating_sub(COLOURS_BEFORE)..splat {
            let mut square = 0.0;
            for axis in 0..3 {
                let off = f64::from(corners[j][axis]) - f64::from(corners[splat][axis]);
                square += off * off;
            }
            let weight = 1.0 / ((square + 1.0) * (square + 1.0));
            let weighted = weight * two_to(self.exponents[j]);
            for (sum, &code) in sums.iter_mut().zip(&self.sh[j * width..]) {
                *sum += weighted * f64::from(code);
            }
            total += weight;
        }
        let step = two_to(self.exponents[splat]);
        if total > 0.0 { sums.map(|sum| code(sum / total / step)) } else { [0; 3] }
    }
}
