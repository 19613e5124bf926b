//! The coordinates in which an SPZ file may be stored, and how to turn splats from them to those that the format prescribes.
//!
//! A system is named after where its axes x, y and z point: right or left, up or down, back (to the viewer) or front. Half of
//! the sixteen are left-handed. Niantic's library has a slip in four: from systems whose y is back or front it negates y where
//! z (up or down) differs from RFU and the reverse, so that LFD, RFD, LBU and RBU come out half a turn about x from what their
//! letters say. Here the letters count.

use crate::math::quaternion;
use crate::math::sh::Turn;

/// A system of coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coordinates(&'static str);

/// In the order of the codes, which begin at 1.
const NAMES: [&str; 16] = [
    "LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF", "LFD", "RFD", "LFU", "RFU", "LBD", "RBD", "LBU",
    "RBU",
];

impl Coordinates {
    /// The system with a code; `None` if there is none.
    pub fn from_code(code: u32) -> Option<Self> {
        NAMES.get((code as usize).checked_sub(1)?).map(|name| Self(name))
    }

    /// Three letters.
    pub fn name(self) -> &'static str {
        self.0
    }

    /// Whether the format prescribes these: right, up, back.
    pub fn is_prescribed(self) -> bool {
        self.0 == "RUB"
    }

    /// From these coordinates to right, up, back.
    pub fn turn(self) -> TurnBack {
        let axis = |letter: u8| match letter {
            b'R' => [1.0, 0.0, 0.0],
            b'L' => [-1.0, 0.0, 0.0],
            b'U' => [0.0, 1.0, 0.0],
            b'D' => [0.0, -1.0, 0.0],
            b'B' => [0.0, 0.0, 1.0],
            _ => [0.0, 0.0, -1.0],
        };
        let [x, y, z] = std::array::from_fn(|i| axis(self.0.as_bytes()[i]));
        let cross: [f64; 3] = std::array::from_fn(|i| {
            let [j, k] = [(i + 1) % 3, (i + 2) % 3];
            x[j] * y[k] - x[k] * y[j]
        });
        let is_mirrored = (0..3).map(|i| cross[i] * z[i]).sum::<f64>() < 0.0;
        let sign = if is_mirrored { -1.0 } else { 1.0 };
        let rotation = quaternion::from_axes([x, y, z].map(|axis: [f64; 3]| axis.map(|v| sign * v)));
        TurnBack { axes: [x, y, z], is_mirrored, rotation, sh: Turn::new(rotation) }
    }
}

/// Turns splats to right, up, back. A mirroring is a rotation with an inversion, which ellipsoids do not notice.
pub struct TurnBack {
    /// Where x, y and z point.
    axes: [[f64; 3]; 3],
    is_mirrored: bool,
    /// The rotation, wxyz.
    rotation: [f64; 4],
    sh: Turn,
}

impl TurnBack {
    /// Turns a point; exact.
    pub fn position(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [a, b, c] = self.axes.map(|axis| axis.map(|v| v as f32));
        std::array::from_fn(|i| a[i] * x + b[i] * y + c[i] * z)
    }

    /// Turns the axes of an ellipsoid, wxyz.
    pub fn rotation(&self, q: [f64; 4]) -> [f64; 4] {
        quaternion::product(self.rotation, q)
    }

    /// Turns SH coefficients. `[(degree + 1)^2, 3]`
    pub fn sh(&self, sh: &[f32]) -> Vec<f32> {
        let mut turned: Vec<f32> = self.sh.apply(sh).into_iter().map(|c| c as f32).collect();
        turned[..3].copy_from_slice(&sh[..3]);
        if self.is_mirrored {
            // Seen from the opposite direction: odd degrees (1, and 3 from index 9) change their sign.
            turned
                .iter_mut()
                .enumerate()
                .filter(|(i, _)| matches!(i / 3, 1..4 | 9..))
                .for_each(|(_, c)| *c = -*c);
        }
        turned
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sh::basis;

    /// The matrix of a quaternion, by columns.
    fn columns(q: [f64; 4]) -> [[f64; 3]; 3] {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| quaternion::turned(q, axis))
    }

    #[test]
    fn a_point_keeps_its_place_in_all_systems() {
        // What Niantic's tests state, and the letters.
        let of = |name: &str| {
            let code = NAMES.iter().position(|n| *n == name).unwrap() as u32 + 1;
            Coordinates::from_code(code).unwrap().turn()
        };
        assert_eq!(of("RDF").position([1.0, -2.0, -3.0]), [1.0, 2.0, 3.0]);
        assert_eq!(of("RBD").position([1.0, 2.0, 3.0]), [1.0, -3.0, 2.0]);
        assert_eq!(of("LFU").position([-1.0, -3.0, 2.0]), [1.0, 2.0, 3.0]);
        assert_eq!(of("RFD").position([1.0, -3.0, -2.0]), [1.0, 2.0, 3.0]);
        assert!(Coordinates::from_code(0).is_none() && Coordinates::from_code(17).is_none());
        assert!(Coordinates::from_code(4).unwrap().is_prescribed());
        assert_eq!(NAMES.iter().filter(|n| of(n).is_mirrored).count(), 8);
    }

    #[test]
    fn shapes_and_colours_turn_with_the_points() {
        let q = [0.5, -0.1, 0.7, 0.5];
        let scales = [0.3, 0.2, 0.01_f64];
        let sh: Vec<f32> = (0..48).map(|i| ((i * 37 % 23) as f32 - 11.0) / 7.0).collect();
        for code in 1..=16 {
            let turn = Coordinates::from_code(code).unwrap().turn();
            let moved = |v: [f64; 3]| turn.position(v.map(|v| v as f32)).map(f64::from);
            let (before, after) = (columns(q), columns(turn.rotation(q)));
            let covariance = |axes: [[f64; 3]; 3], i: usize, j: usize| {
                (0..3).map(|a| scales[a].powi(2) * axes[a][i] * axes[a][j]).sum::<f64>()
            };
            let expected = before.map(moved);
            let mut worst = 0.0_f64;
            for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
                worst = worst.max((covariance(after, i, j) - covariance(expected, i, j)).abs());
            }
            assert!(worst < 1e-8, "{code}: {worst}"); // needed 4e-9: f32
            let turned = turn.sh(&sh);
            let direction = [0.6, -0.48, 0.64];
            let colour = |sh: &[f32], d: [f64; 3]| -> f64 {
                basis(d).iter().enumerate().map(|(k, y)| y * f64::from(sh[3 * k])).sum()
            };
            let (here, there) = (colour(&sh, direction), colour(&turned, moved(direction)));
            assert!((here - there).abs() < 1e-5, "{code}: {here} {there}"); // needed 4e-7
            assert_eq!(
                (colour(&turned, direction) - there).abs() < 1e-3,
                code == 4,
                "negative control {code}"
            );
        }
    }
}
