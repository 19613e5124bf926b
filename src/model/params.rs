//! The size of a model in parameters, the unit in which budgets and results are compared.

use std::ops::{Add, Mul};

/// Parameters of a splat without texels, as published: those of SH degree 3, whatever degree is stored.
pub const SPLAT_PARAMS: u8 = 59;
/// Parameters of a texel: RGB.
pub const TEXEL_PARAMS: u8 = 3;

/// Parameters of so many splats and texels; of whichever kind of number these are counted in, for differences
/// of sizes are weighed too. The result must be within its range.
pub fn num_params<N: From<u8> + Mul<Output = N> + Add<Output = N>>(splats: N, texels: N) -> N {
    N::from(SPLAT_PARAMS) * splats + N::from(TEXEL_PARAMS) * texels
}
