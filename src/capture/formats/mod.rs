//! Readers of pose and point files, one format a file. They check every number and count before they
//! use it; everything beyond the files is decided elsewhere.

pub(crate) mod bytes;
mod colmap;
mod colmap_bin;
mod colmap_model;
mod colmap_txt;
mod listed_split;
pub(crate) mod ply;
mod reality_capture;
mod transforms;

use super::pose_format::PoseFormat;

/// All pose formats. Where a capture has poses in several, the first one wins.
pub(crate) static FORMATS: &[PoseFormat] = &[colmap::FORMAT, transforms::FORMAT, reality_capture::FORMAT];
