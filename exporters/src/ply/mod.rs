//! The PLY files of 3DGS and 2DGS, for viewers that know no textures: maps are averaged into the base
//! colour. One `vertex` element, one row of floats per splat.
//!
//! | property | meaning |
//! |---|---|
//! | `x y z` | centre, frame of the capture (COLMAP's axes) or, if the asset has another one for files, of that |
//! | `nx ny nz` | the surfel's normal |
//! | `f_dc_0..2` | SH of degree 0 |
//! | `f_rest_*` | SH of the higher degrees, **channel by channel**: 0, 9, 24 or 45 |
//! | `opacity` | logit |
//! | `scale_0 scale_1` | natural logarithm of the standard deviations |
//! | `scale_2` | logarithm of the thickness; absent in the 2DGS flavour |
//! | `rot_0..3` | quaternion wxyz |

use crate::Transform;

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

/// What a comment says of a frame: scale, rotation wxyz, translation.
fn world_comment(frame: &Transform) -> String {
    let numbers = [&[frame.scale], frame.rotation.as_slice(), &frame.translation].concat();
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// The inverse of [`world_comment`]; `None` if it is no frame.
fn world_from_comment(text: &str) -> Option<Transform> {
    let numbers: Vec<f64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let [scale, rotation @ .., x, y, z] = numbers.as_slice() else { return None };
    let frame = Transform { scale: *scale, rotation: rotation.try_into().ok()?, translation: [*x, *y, *z] };
    (frame.is_sound() && frame.inverse().is_sound()).then_some(frame)
}

#[cfg(test)]
mod tests;
