//! Size of a model in parameters, the unit of budgets and results.

use std::ops::{Add, Mul};

/// Parameters of a splat without texels, as published: counted for SH degree 3, whatever the model's degree.
pub const SPLAT_PARAMS: u8 = 59;
/// Parameters of a texel: RGB.
pub const TEXEL_PARAMS: u8 = 3;

/// Parameters of a model of this size. Generic over the number type, because differences of sizes are floats. The
/// result must be within the range of the type.
pub fn num_params<N: From<u8> + Mul<Output = N> + Add<Output = N>>(splats: N, texels: N) -> N {
    N::from(SPLAT_PARAMS) * splats + N::from(TEXEL_PARAMS) * texels
}
