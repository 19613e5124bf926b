//! OpenUSD: `.usda` (text), `.usdc` (binary) and `.usdz` (package). `schema/usd.md` says what each prim and property means.
//!
//! A file holds a stage with y up: a node with the way to the capture's frame, and below it three representations as
//! variants: `textured` (a particle field of surflets with maps, the truth), `splat3d` (thin 3D Gaussians for programs
//! that know only those) and `mesh` (baked rectangles, a preview).

mod binary;
mod fallback;
mod field;
mod files;
mod layer;
mod lexer;
mod names;
mod numbers;
mod package;
mod read;
mod sections;
mod stage;
mod text_read;
mod text_values;
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
