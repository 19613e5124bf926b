//! What the containers of all versions hold, and the checks that they share.

use super::extensions::Extensions;
use super::{MAGIC, NUM_STREAMS};
use crate::files::limits::splat_bytes;
use crate::math::sh::{SH_DEGREE_MAX, SH_DEGREE_READ_MAX};
use crate::{Error, ReadLimits, Result, SPLATS_MAX, num_sh_coefficients};
use std::path::Path;

/// All streams together hold at most this many times the file's bytes. Scenes reach 4 to 8. SH of zeros takes no room, but
/// the nine bytes of a centre among a splat's 65 hardly compress. Ten times that.
const EXPANSION_MAX: u64 = 80;
/// Files of few splats that are alike may exceed [`EXPANSION_MAX`].
const SMALL_BYTES: u64 = 16 << 20;

/// What all versions state at the same places: the first 16 bytes.
pub struct Header {
    pub version: u32,
    pub num_splats: usize,
    /// Of the streams.
    pub stored_sh_degree: u32,
    pub fractional_bits: u32,
    pub flags: u8,
    /// Number of streams in version 4; reserved before.
    pub last: u8,
}

/// Bytes of the common header.
pub const HEADER_BYTES: usize = 16;

impl Header {
    /// # Errors
    /// [`Error::Invalid`], [`Error::Unsupported`] for versions and degrees that are not known, [`Error::TooLarge`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let word = |at: usize| bytes.get(at..at + 4)?.first_chunk().map(|b| u32::from_le_bytes(*b));
        let cut = || invalid!(path, "{} bytes, the header of an SPZ file has 16", bytes.len());
        let (Some(magic), Some(version), Some(count), Some(&[sh_degree, fractional_bits, flags, last])) =
            (word(0), word(4), word(8), bytes.get(12..).and_then(<[u8]>::first_chunk))
        else {
            return Err(cut());
        };
        if magic != MAGIC {
            let found = magic.to_le_bytes();
            return Err(invalid!(path, "begins with {found:02x?}, expected \"NGSP\": not an SPZ file"));
        }
        if !(1..=4).contains(&version) {
            return Err(unsupported!(path, "SPZ version {version}; supported: 1 to 4"));
        }
        if u32::from(sh_degree) > SH_DEGREE_READ_MAX {
            return Err(unsupported!(path, "SH degree {sh_degree}; supported: 0 to {SH_DEGREE_READ_MAX}"));
        }
        if fractional_bits > 30 {
            return Err(invalid!(path, "{fractional_bits} fractional bits, expected at most 30"));
        }
        let num_splats = count as usize;
        if num_splats > SPLATS_MAX {
            return Err(too_large!(path, "{num_splats} splats, at most {SPLATS_MAX}"));
        }
        let [stored_sh_degree, fractional_bits] = [sh_degree, fractional_bits].map(u32::from);
        Ok(Self { version, num_splats, stored_sh_degree, fractional_bits, flags, last })
    }

    /// Of the asset.
    pub fn sh_degree(&self) -> u32 {
        self.stored_sh_degree.min(SH_DEGREE_MAX)
    }

    /// Bytes of a splat in each of the streams.
    pub fn widths(&self) -> [usize; NUM_STREAMS] {
        let position = if self.version == 1 { 6 } else { 9 };
        let rotation = if self.version < 3 { 3 } else { 4 };
        [position, 1, 3, 3, rotation, 3 * (num_sh_coefficients(self.stored_sh_degree) - 1)]
    }

    /// Bytes of the streams, after checking that a file of `file_bytes` may hold that many.
    ///
    /// # Errors
    /// [`Error::TooLarge`].
    pub fn sizes(&self, file_bytes: usize, path: &Path, limits: &ReadLimits) -> Result<[usize; NUM_STREAMS]> {
        let n = self.num_splats;
        let sizes = self.widths().map(|width| width * n);
        let total: u64 = sizes.iter().map(|&s| s as u64).sum();
        limits.check(total + splat_bytes(self.sh_degree()) * n as u64, &format!("{n} splats"), path)?;
        let most = EXPANSION_MAX.saturating_mul(file_bytes as u64).max(SMALL_BYTES);
        if total > most {
            let what = format!("{total} bytes of splats in a file of {file_bytes}, at most {most}");
            return Err(Error::too_large(path, what));
        }
        Ok(sizes)
    }
}

/// One attribute of all splats.
pub struct Stream {
    pub data: Vec<u8>,
    /// Its share of the file.
    pub packed_bytes: u64,
}

/// A file, decompressed.
pub struct Container {
    pub header: Header,
    pub streams: Vec<Stream>,
    /// What else the file says.
    pub extensions: Extensions,
}
