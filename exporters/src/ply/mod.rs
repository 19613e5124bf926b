//! The PLY files of 3DGS and 2DGS, for viewers without texture support: maps are averaged into the base colour. One
//! `vertex` element, one row of floats per splat.
//!
//! | property | meaning |
//! |---|---|
//! | `x y z` | centre, in the frame of the capture (COLMAP's axes) or in the asset's frame of files, if it has one |
//! | `nx ny nz` | the splat's normal |
//! | `f_dc_0..2` | SH of degree 0 |
//! | `f_rest_*` | SH of the higher degrees, **channel by channel**: 0, 9, 24 or 45; of the 72 of other programs, degree 4 is dropped |
//! | `opacity` | logit |
//! | `scale_0 scale_1` | natural logarithm of the standard deviations |
//! | `scale_2` | logarithm of the thickness; absent in the 2DGS flavour |
//! | `rot_0..3` | quaternion wxyz |
//!
//! Where the frame of the file is not the capture's, the comment `world_from_capture` states the transform between them (scale,
//! rotation wxyz, translation), which our reader undoes; `origin`, for people and other programs, which point of the capture lies
//! at the origin of the file, if it is another than 0 0 0. In our files it moves the splats back where `world_from_capture` was
//! lost; a turn is lost with it then.

use crate::Transform;

mod columns;
mod escape;
mod header;
mod local_origin;
mod read;
mod rows;
mod scalar;
mod validate;
mod write;

pub use header::{Element, Encoding, Header, Kind, Property};
pub use read::{PlyContents, decode_ply, read_ply};
pub use scalar::Scalar;
pub use validate::validate;
pub use write::{PlyFlavour, PlyOptions, PlySummary, PlyUp, encode_ply};

/// Beginning of the comment that marks files whose other comments are escaped.
const COMMENT_OURS: &str = "written by: litetex ";

/// Comment by which SuperSplat and splat-transform recognise files without `scale_2`.
const COMMENT_2DGS: &str = "SplatRenderMode: 2dgs";

/// A transform as the text of a comment: scale, rotation wxyz, translation.
fn world_comment(frame: &Transform) -> String {
    let numbers = [&[frame.scale], frame.rotation.as_slice(), &frame.translation].concat();
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// The inverse of [`world_comment`]; `None` if the text is not a transform.
fn world_from_comment(text: &str) -> Option<Transform> {
    let numbers: Vec<f64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let [scale, rotation @ .., x, y, z] = numbers.as_slice() else { return None };
    let frame = Transform { scale: *scale, rotation: rotation.try_into().ok()?, translation: [*x, *y, *z] };
    (frame.is_sound() && frame.inverse().is_sound()).then_some(frame)
}

/// The point of a comment `origin`; `None` if the text is none.
fn origin_from_comment(text: &str) -> Option<[f64; 3]> {
    let numbers: Vec<f64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let origin: [f64; 3] = numbers.try_into().ok()?;
    Transform::scaled_and_moved(1.0, origin).is_sound().then_some(origin)
}

#[cfg(test)]
mod tests;
