//! SPZ, the compact format of untextured splats, by Niantic's library of that name. Written as version 3, which most programs
//! read, or as version 4; versions 1 to 4 are read. Maps are averaged into the base colour, as in PLY. The frame is that of the
//! file with y up (x right, y up, z back: "RUB").
//!
//! | stream | bytes per splat | meaning |
//! |---|---|---|
//! | positions | 9 | three fixed-point numbers of 24 bits; version 1: 6, three floats of 16 bits |
//! | alphas | 1 | opacity times 255 |
//! | colours | 3 | SH of degree 0, times 0.15 times 255, from 127.5 |
//! | scales | 3 | (natural logarithm + 10) times 16; the third is thin |
//! | rotations | 4 | index of the largest of xyzw (2 bits), then sign and 9 bits for each other; versions 1 and 2: 3, x y z of
//! 8 bits with w positive |
//! | SH | 3 ((degree + 1)^2 - 1) | coefficient times 128, from 128, in steps that the writer chooses ([`ShBits`]) |
//!
//! Our metadata are where other programs do not look, so that none warns of them: in version 3 an extra field of the gzip header,
//! in version 4 a record between header and table of contents that no flag announces. They hold the frame, near plane,
//! filter, background and the texts of the provenance, about 500 bytes, and cameras only if they are asked for. Of the records of
//! others, that of the coordinates is read, and splats stored in other ones are turned; unknown records are warned of.

mod container;
mod coordinates;
mod extensions;
mod float16;
mod gzip;
mod read;
mod rotation;
mod validate;
mod write;
mod zstd_streams;

pub use read::{decode_spz, read_spz};
pub use validate::validate;
pub use write::{SpzSummary, encode_spz};

/// The first bytes of a file, of version 1 to 3 when decompressed: "NGSP".
const MAGIC: u32 = 0x5053_474e;
const NUM_STREAMS: usize = 6;
/// Names of the streams in reports.
const NAMES: [&str; NUM_STREAMS] = ["positions", "opacities", "sh0", "scales", "rotations", "sh_rest"];
/// Bit of the header's flags: trained with a low-pass filter in the image that keeps the light of thin splats.
const ANTIALIASED: u8 = 0x1;
const COLOUR_SCALE: f64 = 0.15;

/// Versions of the format that are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpzVersion {
    /// One gzip stream. Readers that know no later version are many.
    #[default]
    V3,
    /// A zstd stream for each attribute.
    V4,
}

impl SpzVersion {
    fn number(self) -> u32 {
        match self {
            Self::V3 => 3,
            Self::V4 => 4,
        }
    }
}

/// Bits of SH coefficients, 1 to 8. All are stored in a byte each; with fewer bits the lower ones hold nothing and compress to
/// nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShBits {
    /// Of degree 1.
    pub first: u8,
    /// Of degrees 2 and 3.
    pub rest: u8,
}

impl ShBits {
    /// The finest that the format has.
    pub const MOST: Self = Self { first: 8, rest: 8 };

    /// Step between the codes of an SH coefficient, by its index: 1 to 128.
    fn step(self, coefficient: usize) -> u32 {
        let bits = if coefficient < 4 { self.first } else { self.rest };
        1 << (8 - bits.clamp(1, 8))
    }
}

impl Default for ShBits {
    /// What four captures need for 50 dB and more, measured by rendering; with 5 and 4 bits, as Niantic's own writer takes, one
    /// of them has 41 dB.
    fn default() -> Self {
        Self { first: 6, rest: 6 }
    }
}

/// How to write a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SpzOptions {
    /// Version of the format.
    pub version: SpzVersion,
    /// Bits of SH coefficients.
    pub sh_bits: ShBits,
    /// Whether the metadata hold the cameras of the capture.
    pub cameras: bool,
}

#[cfg(test)]
mod tests;
