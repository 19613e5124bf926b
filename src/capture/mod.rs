//! Captures: posed photos and sparse points read from files and brought into the frame, size and colour
//! space of training. Nothing here knows how training or rendering works.

mod advice;
#[cfg(test)]
mod beside_tests;
#[cfg(test)]
mod broken_lines_tests;
mod check;
mod claims;
mod decode;
mod elsewhere;
mod exr_photo;
pub(crate) mod extensions;
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
mod masks;
mod masks_apart;
mod options;
mod overlap;
pub(crate) mod paths;
mod photo_files;
mod photo_folder;
mod photos;
mod photos_apart;
mod photos_near;
#[cfg(test)]
mod photos_tests;
mod pinned;
mod pixel;
mod plausible;
mod pose_format;
mod recipes;
mod repeated;
#[cfg(test)]
mod repeated_tests;
mod source;
mod split;
mod store;
mod stored;
#[cfg(test)]
mod strangers_tests;
#[cfg(test)]
mod tests;
mod undistortion;
mod unposed;
mod verdict;
mod warp;
#[cfg(test)]
mod warp_tests;
mod zipped;

pub use decode::read_image;
pub use extensions::is_read as is_image_name;
pub use formats::ply::read_points as read_ply_points;
pub use health::SparseHealth;
pub use loaded::{Capture, View};
pub use options::{CaptureFormat, ExifTurn, LoadOptions, UndistortFocal};
pub use undistortion::Undistortion;
pub use verdict::{Figures, Rating, Reason, Verdict};
