//! Readers of pose and point files, one format a file. They check every number and count before they
//! trust it; what a capture means beyond its files is decided elsewhere.

pub(crate) mod bytes;
pub(crate) mod colmap;
pub(crate) mod colmap_bin;
pub(crate) mod colmap_model;
pub(crate) mod colmap_txt;
pub(crate) mod ply;
pub(crate) mod reality_capture;
pub(crate) mod transforms;
