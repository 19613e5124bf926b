//! Asset formats for textured Gaussian splats: the neutral model [`SplatAsset`], writers and readers.
//!
//! Nothing here renders, trains or prints. Readers treat files as hostile: they return an [`Error`],
//! never panic, and allocate no more than the file's own size warrants.

#![forbid(unsafe_code)]

mod asset;
mod error;
mod file;
pub mod ply;
mod validate;

pub use asset::{
    AssetCamera, AssetMap, CaptureFromLocal, ColourSpace, MAP_SIDE_MAX, Provenance, SPLATS_MAX, SplatAsset,
    num_sh_coefficients,
};
pub use error::{Error, Result};
pub use file::write_atomically;
