//! Asset formats for textured Gaussian splats: the neutral model [`SplatAsset`], writers and readers.
//!
//! Nothing here renders, trains or prints. Readers treat files as hostile: they return an [`Error`],
//! never panic, and allocate no more than the size of the file warrants.

#![forbid(unsafe_code)]

mod asset;
mod atlas;
pub mod atomic_file;
mod baked;
mod contents;
mod degrees;
mod depth_order;
mod edit;
mod ellipsoid;
mod error;
mod fallback;
mod file;
mod format;
mod frame;
pub mod gltf;
mod hash;
pub mod html;
mod limits;
pub mod ltgs;
mod meta;
mod overview;
mod plain;
pub mod ply;
mod quads;
mod quality;
mod quaternion;
mod sh;
mod shown_cameras;
mod sidecars;
mod sniff;
pub mod spz;
mod staging;
mod text;
pub mod usd;
mod validate;
mod written;
mod yup;

pub use asset::{
    AssetCamera, AssetMap, ColourSpace, Filter, MAP_SIDE_MAX, Provenance, SPLATS_MAX, SplatAsset,
};
pub use contents::{Contents, Describes, Issue, LayerSize, ReadLimits, Section, Severity};
pub use error::{Error, Result};
pub use file::{read_file, regular_file_bytes};
pub use format::kind::{Format, unknown_kind};
pub use format::{WriteOptions, read_asset, read_fallback, stage_asset, validate_file, write_asset};
pub use frame::Transform;
pub use overview::{Bounds, Overview};
pub use quality::Quality;
pub use sh::num_sh_coefficients;
pub use shown_cameras::Cameras;
pub use staging::Staged;
pub use text::quoted;
pub use written::Written;
