//! Small vector functions. Those on lanes are generic over the SIMD level and inlined into the kernels.

use fearless_simd::{Bytes as _, Simd, SimdBase as _, SimdFloat as _, f32x16, i32x16, mask32x16};

/// Pixels of a block along x and y; a block fills the lanes of a vector. (Measured on fox at 270x480: 4 x 4 lanes are
/// faster than 4 x 2, although more of them lie outside the splat.)
pub(super) const BLOCK_PX: [usize; 2] = [4, 4];
/// Lanes of a vector.
pub(super) const LANES: usize = BLOCK_PX[0] * BLOCK_PX[1];
/// One value per pixel of a block.
pub(super) type Lanes<S> = f32x16<S>;
/// One truth value per pixel of a block.
pub(super) type LaneMask<S> = mask32x16<S>;
/// One integer per pixel of a block.
type LaneInts<S> = i32x16<S>;

/// e^x for x in [-80, 80], with a relative error below 2.4e-7 (the test measures it).
#[inline(always)]
pub(super) fn exp<S: Simd>(simd: S, x: Lanes<S>) -> Lanes<S> {
    let c = |v: f32| Lanes::splat(simd, v);
    // 2^(n + f), f in [-1/2, 1/2]. Floats of this size are whole numbers: the sum rounds, and its lowest bits are those of n.
    let whole = c(12_582_912.0);
    let rounded = x.mul_add(c(std::f32::consts::LOG2_E), whole);
    let n = rounded - whole;
    // Splitting ln 2 in two keeps the reduced argument x - n ln 2 accurate.
    let f = n.mul_add(c(-1.428_606_8e-6), n.mul_add(c(-0.693_145_75), x));
    // Taylor coefficients in pairs: a shorter chain of dependent operations than one by one.
    let square = f * f;
    let mut p = f.mul_add(c(1.0 / 720.0), c(1.0 / 120.0));
    p = p.mul_add(square, f.mul_add(c(1.0 / 24.0), c(1.0 / 6.0)));
    p = p.mul_add(square, f.mul_add(c(0.5), c(1.0)));
    p = p.mul_add(f, c(1.0));
    let (exponent, p): (LaneInts<S>, LaneInts<S>) = (rounded.bitcast(), p.bitcast());
    (p + (exponent << 23)).bitcast()
}

/// `tanh(t / 2)`.
#[inline(always)]
fn texel_value<S: Simd>(simd: S, t: Lanes<S>) -> Lanes<S> {
    let t = t.max(-60.0_f32).min(60.0_f32);
    2.0 / (exp(simd, -t) + 1.0) - 1.0
}

/// `tanh(t / 2)` for every element of a slice: the activation of texels.
#[inline(always)]
pub(super) fn texel_values<S: Simd>(simd: S, stored: &[f32], values: &mut [f32]) {
    let mut stored_chunks = stored.chunks_exact(LANES);
    let mut value_chunks = values.chunks_exact_mut(LANES);
    for (t, v) in (&mut stored_chunks).zip(&mut value_chunks) {
        texel_value(simd, Lanes::from_slice(simd, t)).store_slice(v);
    }
    let (t, v) = (stored_chunks.remainder(), value_chunks.into_remainder());
    let mut padded = [0.0; LANES];
    padded[..t.len()].copy_from_slice(t);
    let last: [f32; LANES] = texel_value(simd, Lanes::from_slice(simd, &padded)).into();
    v.copy_from_slice(&last[..t.len()]);
}

pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::simd::dispatch;
    use fearless_simd::Level;

    #[test]
    fn exp_and_texel_values_are_accurate() {
        let mut worst = 0.0_f64;
        for i in 0..200_000 {
            let x = -40.0 + i as f32 * 4e-4;
            let got: [f32; LANES] = dispatch!(Level::new(), simd => exp(simd, Lanes::splat(simd, x)).into());
            worst = worst.max((f64::from(got[3]) / f64::from(x).exp() - 1.0).abs());
        }
        assert!(worst < 4e-7, "{worst:.2e}"); // needed 3.6e-7, including the rounding of the argument
        let stored: Vec<f32> = (0..1003).map(|i| (i as f32 - 500.0) * 0.02).collect();
        let mut values = vec![0.0; stored.len()];
        dispatch!(Level::new(), simd => texel_values(simd, &stored, &mut values));
        let worst = stored
            .iter()
            .zip(&values)
            .map(|(&t, &v)| (crate::model::texel_value(f64::from(t)) - f64::from(v)).abs())
            .fold(0.0, f64::max);
        assert!(worst < 3e-7, "{worst:.2e}");
        assert_eq!(values[500], 0.0, "a neutral texel adds exactly 0");
    }
}
