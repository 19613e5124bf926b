//! Spherical harmonics with the signs and the order of 3DGS, and their rotation with the scene.

use crate::math::quaternion;

/// Y_00, the constant of degree 0.
pub const SH_0: f64 = 0.282_094_791_773_878_14;

const SH_1: f64 = 0.488_602_511_902_919_9;
const SH_2: [f64; 3] = [1.092_548_430_592_079_1, 0.315_391_565_252_520_05, 0.546_274_215_296_039_6];
const SH_3: [f64; 5] = [
    0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    1.445_305_721_320_277,
];

/// Highest degree that assets hold.
pub const SH_DEGREE_MAX: u32 = 3;

/// Highest degree that is read: SPZ holds it since version 3, and its converter writes it to PLY.
pub const SH_DEGREE_READ_MAX: u32 = 4;

/// What to say of splats of another program of this degree; `None` if the asset holds all of it.
pub fn dropped_sh(degree: u32) -> Option<String> {
    let what = format!(
        "SH of degree {degree}: kept up to degree {SH_DEGREE_MAX}, which leaves out the finest reflections"
    );
    (degree > SH_DEGREE_MAX).then_some(what)
}

/// SH coefficients per colour channel, for all degrees up to this one.
pub const fn num_sh_coefficients(degree: u32) -> usize {
    ((degree + 1) * (degree + 1)) as usize
}

/// All basis functions up to degree 3, at a unit direction.
pub fn basis([x, y, z]: [f64; 3]) -> [f64; 16] {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        SH_0,
        -SH_1 * y,
        SH_1 * z,
        -SH_1 * x,
        SH_2[0] * x * y,
        -SH_2[0] * y * z,
        SH_2[1] * (2.0 * zz - xx - yy),
        -SH_2[0] * x * z,
        SH_2[2] * (xx - yy),
        -SH_3[0] * y * (3.0 * xx - yy),
        SH_3[1] * x * y * z,
        -SH_3[2] * y * (4.0 * zz - xx - yy),
        SH_3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -SH_3[2] * x * (4.0 * zz - xx - yy),
        SH_3[4] * z * (xx - yy),
        -SH_3[0] * x * (xx - 3.0 * yy),
    ]
}

/// Rotates SH coefficients with the scene: the same function of direction in new axes.
pub struct Turn {
    /// `new[k] = sum_j matrix[k][j] old[j]`; zero between degrees.
    matrix: [[f64; 16]; 16],
}

impl Turn {
    /// The rotation by `new_from_old`, a unit quaternion wxyz.
    pub fn new(new_from_old: [f64; 4]) -> Self {
        // The integral of Y_k(d) Y_j(old d) over the sphere: products of degree 6 at most, which four Gauss-Legendre
        // points in z and eight in azimuth integrate exactly.
        const NODES: [(f64, f64); 4] = [
            (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
            (-0.339_981_043_584_856_26, 0.652_145_154_862_546_2),
            (0.339_981_043_584_856_26, 0.652_145_154_862_546_2),
            (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
        ];
        let mut matrix = [[0.0; 16]; 16];
        let old_from_new = quaternion::conjugate(new_from_old);
        for (z, weight) in NODES {
            for step in 0..8 {
                let (sin, cos) = (f64::from(step) * std::f64::consts::FRAC_PI_4).sin_cos();
                let across = (1.0 - z * z).sqrt();
                let in_new = [across * cos, across * sin, z];
                let (new, old) = (basis(in_new), basis(quaternion::turned(old_from_new, in_new)));
                for (row, n) in matrix.iter_mut().zip(new) {
                    for (entry, o) in row.iter_mut().zip(old) {
                        *entry += weight * std::f64::consts::FRAC_PI_4 * n * o;
                    }
                }
            }
        }
        Self { matrix }
    }

    /// The coefficients of a splat in the new axes. `[(degree + 1)^2, 3]`
    pub fn apply(&self, sh: &[f32]) -> Vec<f64> {
        let count = sh.len() / 3;
        let mut out = vec![0.0; sh.len()];
        for degree in 0..4 {
            let first = if degree == 0 { 0 } else { num_sh_coefficients(degree - 1) };
            let range = first..num_sh_coefficients(degree).min(count);
            for k in range.clone() {
                for channel in 0..3 {
                    out[3 * k + channel] =
                        range.clone().map(|j| self.matrix[k][j] * f64::from(sh[3 * j + channel])).sum();
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURN: [f64; 4] = [0.5, -0.1, 0.7, 0.5];

    #[test]
    fn rotated_coefficients_give_equal_colours_in_rotated_directions() {
        let turn = Turn::new(TURN);
        let sh: Vec<f32> = (0..48).map(|i| ((i * 37 % 23) as f32 - 11.0) / 7.0).collect();
        let turned = turn.apply(&sh);
        let mut worst = 0.0_f64;
        for i in 0..50 {
            let (a, z) = (f64::from(i) * 2.4, f64::from(i) / 25.0 - 0.98);
            let across = (1.0 - z * z).sqrt();
            let d = [across * a.cos(), across * a.sin(), z];
            let [old, new] = [basis(d), basis(quaternion::turned(TURN, d))];
            for channel in 0..3 {
                let before: f64 = (0..16).map(|k| old[k] * f64::from(sh[3 * k + channel])).sum();
                let after: f64 = (0..16).map(|k| new[k] * turned[3 * k + channel]).sum();
                worst = worst.max((before - after).abs());
            }
        }
        assert!(worst < 1e-12, "{worst}"); // needed 3e-15
        // Negative control: the opposite turn.
        let wrong = Turn::new(quaternion::conjugate(TURN)).apply(&sh);
        assert!((wrong[4] - turned[4]).abs() > 0.1);
    }
}
