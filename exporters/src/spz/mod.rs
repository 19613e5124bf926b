//! SPZ version 4, the compact format of untextured splats: six streams of bytes, each compressed by zstd. Maps are averaged
//! into the base colour, as in PLY. The frame is that of the capture with y up (x right, y up, z back).
//!
//! | stream | bytes per splat | meaning |
//! |---|---|---|
//! | positions | 9 | three fixed-point numbers of 24 bits |
//! | alphas | 1 | opacity times 255 |
//! | colours | 3 | SH of degree 0, times 0.15 times 255, from 127.5 |
//! | scales | 3 | (natural logarithm + 10) times 16; the third is thin |
//! | rotations | 4 | index of the largest of xyzw (2 bits), then sign and 9 bits for each other |
//! | SH | 3 ((degree + 1)^2 - 1) | coefficient times 128, from 128, in steps of 8 (degree 1) or 16 |

mod read;
mod rotation;
mod validate;
mod write;

pub use read::{decode_spz, read_spz};
pub use validate::validate;
pub use write::{SpzSummary, encode_spz, write_spz};

/// The first bytes of a file: "NGSP".
const MAGIC: u32 = 0x5053_474e;
const VERSION: u32 = 4;
const HEADER_BYTES: usize = 32;
/// An entry of the table of contents: the sizes of a stream, compressed and not.
const TOC_ENTRY_BYTES: usize = 16;
const NUM_STREAMS: usize = 6;
/// Bit of the header's flags: extension records lie between header and table.
const HAS_EXTENSIONS: u8 = 0x2;
/// Type of our extension record, which holds the metadata as JSON. Other programs skip it by its length.
const META_RECORD: u32 = 0x4c54_0001;
const COLOUR_SCALE: f64 = 0.15;

/// Step between the codes of an SH coefficient, by its index.
fn sh_step(coefficient: usize) -> f64 {
    if coefficient < 4 { 8.0 } else { 16.0 }
}

#[cfg(test)]
mod tests;
