//! The compact binary format `.ltgs`: chunks of 4,096 splats with their maps, each independently readable, in layers: those that
//! contribute most come first. In each layer, the geometry of all splats precedes their view-dependent colours, and these the
//! first texel. `schema/ltgs.md` specifies every byte.
//!
//! | part | content |
//! |---|---|
//! | header | 64 bytes: version, counts, lengths, checksums |
//! | metadata | JSON: frame, cameras, provenance, hash, steps |
//! | contents | layer, position, counts, bounds and checksums of each chunk |
//! | stand-in | a small `.ltgs` file that is shown first, if there is one |
//! | geometry | per chunk: one stream per attribute, SH of degree 0 included; it contains the maps' means |
//! | SH | per chunk: degrees of splats, and streams of the coefficients above degree 0 that they have |
//! | texels | per chunk: a stream of texels |
//!
//! The last three parts are repeated for each layer.
//!
//! Lossless files hold the bytes of the numbers; others hold numbers rounded by [`Steps`], which the caller chooses by
//! rendering what [`quantised`] returns.

mod arithmetic;
mod bands;
mod bits;
mod check;
mod colour;
mod colours;
mod contexts;
mod header;
mod integers;
mod layers;
mod lossless;
mod maps;
mod math;
mod mixing;
mod morton;
mod numbers;
mod orient;
mod plan;
mod positions;
mod predictions;
mod read;
mod sensitivities;
mod shape;
mod splats;
mod stand_in;
mod stand_in_reader;
mod steps;
mod tables;
mod tally;
mod texels;
mod vectors;
mod write;

pub use check::validate;
pub use header::BlockKind;
pub use orient::oriented;
pub use plan::PerSplat;
pub use read::{Reader, decode};
pub use sensitivities::Sensitivities;
pub use stand_in::{StandIn, StandInSize};
pub use steps::Steps;
pub use vectors::coder_vectors;
pub use write::{Effort, LtgsOptions, Rounded, encode, quantised, rounded, rounded_in_place};

#[cfg(test)]
mod tests;
