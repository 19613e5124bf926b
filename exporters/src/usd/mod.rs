//! OpenUSD: `.usda` (text), `.usdc` (binary) and `.usdz` (package). `schema/usd.md` specifies each prim and property.
//!
//! A file holds a stage with y up: a prim with the transform to the world frame, and below it three representations as
//! variants: `textured` (a particle field of surflets with maps, which the asset is read from), `splat3d` (thin 3D
//! Gaussians, for programs that support only those) and `mesh` (textured rectangles, a preview).
//!
//! Readers accept only files that these writers produced.

mod binary;
mod cameras;
mod fallback;
mod field;
mod files;
mod layer;
mod lexer;
mod names;
mod numbers;
mod package;
mod quad_mesh;
mod read;
mod sections;
mod shade;
mod stage;
mod text_read;
mod text_write;
mod validate;
mod value;

pub use fallback::read_fallback;
pub use files::{UsdOptions, write_usd};
pub(crate) use files::{encode_files, stem, textures_name};
pub use read::read_usd;
pub use validate::validate;

#[cfg(test)]
mod tests;
