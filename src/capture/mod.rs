//! Captures: posed photos and sparse points read from files and brought into the frame, size and colour
//! space of training. Nothing here knows how training or rendering works.

mod advice;
mod check;
mod decode;
mod elsewhere;
mod exr_photo;
mod far;
#[cfg(test)]
pub(crate) mod fixtures;
mod folder;
mod formats;
mod frame;
mod health;
mod jpeg_end;
mod jpeg_frame;
mod left_out;
mod lens;
mod load;
mod loaded;
mod options;
mod overlap;
pub(crate) mod photo_files;
mod photos;
#[cfg(test)]
mod photos_tests;
mod plausible;
mod pose_format;
mod source;
mod split;
mod store;
#[cfg(test)]
mod strangers_tests;
#[cfg(test)]
mod tests;
mod undistortion;
mod warp;
#[cfg(test)]
mod warp_tests;
mod zipped;

pub(crate) use advice::shell_word;
pub use decode::read_image;
pub use formats::ply::read_points as read_ply_points;
pub use health::SparseHealth;
pub use loaded::{Capture, View};
pub use options::{CaptureFormat, ExifTurn, LoadOptions, UndistortFocal};
pub use undistortion::Undistortion;
