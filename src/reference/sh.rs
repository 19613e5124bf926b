//! Real spherical harmonics up to degree 3 with the constants, signs and order of 3DGS (method 1.2).

use crate::constants::{SH_0, SH_1, SH_2, SH_3};
use glam::DVec3;

/// The 16 basis functions at a unit direction; those above `degree` are 0.
pub fn sh_basis(degree: u32, d: DVec3) -> [f64; 16] {
    let (x, y, z) = (d.x, d.y, d.z);
    let mut out = [0.0; 16];
    out[0] = SH_0;
    if degree >= 1 {
        out[1..4].copy_from_slice(&[-SH_1 * y, SH_1 * z, -SH_1 * x]);
    }
    if degree >= 2 {
        let band = [x * y, y * z, 2.0 * z * z - x * x - y * y, x * z, x * x - y * y];
        (0..5).for_each(|k| out[4 + k] = SH_2[k] * band[k]);
    }
    if degree >= 3 {
        let band = [
            y * (3.0 * x * x - y * y),
            x * y * z,
            y * (4.0 * z * z - x * x - y * y),
            z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y),
            x * (4.0 * z * z - x * x - y * y),
            z * (x * x - y * y),
            x * (x * x - 3.0 * y * y),
        ];
        (0..7).for_each(|k| out[9 + k] = SH_3[k] * band[k]);
    }
    out
}

/// Derivatives of [`sh_basis`] with respect to the three components of the direction, treated as independent.
pub fn sh_basis_derivative(degree: u32, d: DVec3) -> [DVec3; 16] {
    let (x, y, z) = (d.x, d.y, d.z);
    let mut out = [DVec3::ZERO; 16];
    if degree >= 1 {
        out[1] = DVec3::new(0.0, -SH_1, 0.0);
        out[2] = DVec3::new(0.0, 0.0, SH_1);
        out[3] = DVec3::new(-SH_1, 0.0, 0.0);
    }
    if degree >= 2 {
        let band = [
            DVec3::new(y, x, 0.0),
            DVec3::new(0.0, z, y),
            DVec3::new(-2.0 * x, -2.0 * y, 4.0 * z),
            DVec3::new(z, 0.0, x),
            DVec3::new(2.0 * x, -2.0 * y, 0.0),
        ];
        (0..5).for_each(|k| out[4 + k] = SH_2[k] * band[k]);
    }
    if degree >= 3 {
        let band = [
            DVec3::new(6.0 * x * y, 3.0 * x * x - 3.0 * y * y, 0.0),
            DVec3::new(y * z, x * z, x * y),
            DVec3::new(-2.0 * x * y, 4.0 * z * z - x * x - 3.0 * y * y, 8.0 * y * z),
            DVec3::new(-6.0 * x * z, -6.0 * y * z, 6.0 * z * z - 3.0 * x * x - 3.0 * y * y),
            DVec3::new(4.0 * z * z - 3.0 * x * x - y * y, -2.0 * x * y, 8.0 * x * z),
            DVec3::new(2.0 * x * z, -2.0 * y * z, x * x - y * y),
            DVec3::new(3.0 * x * x - 3.0 * y * y, -6.0 * x * y, 0.0),
        ];
        (0..7).for_each(|k| out[9 + k] = SH_3[k] * band[k]);
    }
    out
}
