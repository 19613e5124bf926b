//! Asset formats for textured Gaussian splats: the neutral model [`SplatAsset`], writers and readers.
//!
//! Nothing here renders, trains or prints. Readers treat files as hostile: they return an [`Error`],
//! never panic, and allocate no more than the size of the file warrants.

#![forbid(unsafe_code)]

#[macro_use]
mod error;

mod asset;
mod atlas;
mod fallback;
mod files;
mod format;
pub mod gltf;
pub mod html;
pub mod ltgs;
mod math;
mod number;
pub mod ply;
pub mod spz;
mod text;
pub mod usd;

pub use asset::origin::ORIGIN_OPTION;
pub use asset::overview::{Bounds, Overview};
pub use asset::{
    AssetCamera, AssetMap, ColourSpace, Filter, MAP_SIDE_MAX, METRES, Provenance, SPLATS_MAX, SplatAsset,
    UNKNOWN_SCALE,
};
pub use error::{Error, Result};
pub use fallback::shown_cameras::Cameras;
pub use files::atomic_file;
pub use files::limits::ReadLimits;
pub use files::read::{read_file, regular_file_bytes};
pub use files::staging::Staged;
pub use files::written::Written;
pub use format::contents::{Contents, Describes, Issue, LayerSize, Section, Severity};
pub use format::kind::{Format, unknown_kind};
pub use format::quality::Quality;
pub use format::{WriteOptions, read_asset, read_fallback, stage_asset, validate_file, write_asset};
pub use math::frame::Transform;
pub use math::sh::num_sh_coefficients;
pub use number::{parse_number, rounded};
pub use text::quoted;
