//! Readers of pose and point files, one format a file. They check every number and count before they
//! use it; everything beyond the files is decided elsewhere.

mod axes;
mod by_name;
pub(crate) mod bytes;
mod colmap;
mod colmap_bin;
mod colmap_find;
mod colmap_lens;
mod colmap_model;
mod colmap_txt;
mod film;
mod frame_uses;
mod json;
mod listed_split;
mod lookup;
mod metashape;
mod metashape_lens;
pub(crate) mod ply;
pub(crate) mod points_files;
mod polycam;
mod reality_capture;
mod reality_xmp;
mod record3d;
mod scannetpp;
mod transforms;
mod transforms_lens;
pub(crate) mod unread;
mod unused;
mod xml;

use super::pose_format::PoseFormat;
pub(crate) use colmap_find::find_elsewhere as find_colmap_elsewhere;

/// All pose formats. Where a capture has poses in several, the first one wins.
pub(crate) static FORMATS: &[PoseFormat] = &[
    colmap_find::FORMAT,
    transforms::FORMAT,
    reality_capture::FORMAT,
    metashape::FORMAT,
    reality_xmp::FORMAT,
    polycam::FORMAT,
    record3d::FORMAT,
    scannetpp::FORMAT,
];
