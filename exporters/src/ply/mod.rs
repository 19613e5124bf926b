//! The PLY files of 3DGS and 2DGS, for viewers that know no textures: maps are averaged into the base
//! colour. One `vertex` element, one row of floats per splat.
//!
//! | property | meaning |
//! |---|---|
//! | `x y z` | centre, capture frame (COLMAP axes; scale and translation are applied) |
//! | `nx ny nz` | the surfel's normal |
//! | `f_dc_0..2` | SH of degree 0 |
//! | `f_rest_*` | SH of the higher degrees, **channel by channel**: 0, 9, 24 or 45 |
//! | `opacity` | logit |
//! | `scale_0 scale_1` | natural logarithm of the standard deviations |
//! | `scale_2` | logarithm of the thickness; absent in the 2DGS flavour |
//! | `rot_0..3` | quaternion wxyz |

mod escape;
mod header;
mod read;
mod rows;
mod scalar;
mod validate;
mod write;

pub use read::{PlyContents, decode_ply, read_ply};
pub(crate) use read::{is_thick, thinnest_last};
pub use scalar::Scalar;
pub use validate::validate;
pub use write::{PlyFlavour, PlyOptions, PlySummary, encode_ply, write_ply};

/// Comment of files whose other comments are escaped.
const COMMENT_OURS: &str = "written by: litetex ";

/// Comment by which SuperSplat and splat-transform know files without `scale_2`.
const COMMENT_2DGS: &str = "SplatRenderMode: 2dgs";

#[cfg(test)]
mod tests;
