//! Bounds on memory while reading: arrays are counted before anything is allocated for them.

use crate::{Error, Result, SplatAsset, num_sh_coefficients};
use std::path::Path;

/// Memory that even the smallest file may take; see [`ReadLimits::of_file`].
const SMALL_BYTES: u64 = 64 << 20;

/// Bytes of memory per byte of a file beyond [`SMALL_BYTES`]: what deflate makes of one at most.
const EXPANSION_MAX: u64 = 1040;

/// How much memory a reader may take.
///
/// Sizes that a file states are compared with the limits before anything is allocated for them. A small file may take
/// less than a large one: see [`ReadLimits::of_file`]. What readers take, and how it is bounded:
///
/// | format | what small files can blow up | bound |
/// |---|---|---|
/// | `.ltgs` | neutral texels (zstd, 1 : 20,000) | `of_file`; chunks and the whole asset at a time: three times that at worst |
/// | HTML | nothing: a `.ltgs` file of three quarters of its size | as `.ltgs` |
/// | glTF, USD | texels of maps | `of_file`; pages are read row by row |
/// | glTF, USD | pages (deflate, 1 : 1,040) | 64 texels for each that maps use, and 2^24 |
/// | glTF | JSON of empty objects (1 : 250) | 131,072 objects and 2,097,152 values |
/// | USD text | prims, properties, entries (1 : 45) and their paths | `of_file`, counted as they are read |
/// | USD binary | tables (LZ4, 1 : 255), paths, values | 2^20 entries; 16 times the file and 32 MiB of values |
/// | USD package | entries of its table | 1,000 |
/// | PLY | properties of a byte (1 : 5), header | the file's own size; 17 MiB and 1,024 names |
/// | SPZ | splats of zeros (zstd) | streams 80 times the file, at least 16 MiB; splats four times that |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Most bytes that a file may have, and most that it may decode to.
    pub decoded_bytes: u64,
    /// Most layers of a `.ltgs` file that are read, from the first; `None`: all. Other formats have no layers.
    pub layers: Option<u32>,
}

impl Default for ReadLimits {
    /// 4 GiB: some ten million splats of SH degree 3, or a million of them with 300 million texels.
    fn default() -> Self {
        Self { decoded_bytes: 4 << 30, layers: None }
    }
}

impl ReadLimits {
    /// The limits for a file of this many bytes, which keep a small file from taking all of
    /// [`ReadLimits::decoded_bytes`].
    ///
    /// Neutral texels compress a thousandfold, so a ratio alone would refuse valid files: 64 MiB are 5 million texels that
    /// take no room in the file, next to splats that do.
    pub fn of_file(&self, file_bytes: u64) -> Self {
        let expanded = SMALL_BYTES.saturating_add(EXPANSION_MAX.saturating_mul(file_bytes));
        Self { decoded_bytes: self.decoded_bytes.min(expanded), ..*self }
    }

    /// Refuses what would decode to more bytes than allowed; `what` names it in the message.
    pub(crate) fn check(&self, bytes: u64, what: &str, path: &Path) -> Result<()> {
        if bytes <= self.decoded_bytes {
            return Ok(());
        }
        let most = self.decoded_bytes;
        Err(too_large!(path, "{what}: {bytes} bytes to decode, at most {most} are allowed for this file"))
    }
}

/// Bytes of a splat in [`crate::SplatAsset`] without the texels of its map: 233 at degree 3, and 20 for the map.
pub(crate) fn splat_bytes(sh_degree: u32) -> u64 {
    1 + 4 * (3 + 4 + 2 + 1 + 5 + 3 * num_sh_coefficients(sh_degree.min(3)) as u64)
}

/// An empty vector with room for `count` values. Fails where allocation fails: counts come from files and must not abort
/// the program.
pub(crate) fn with_room<T>(count: usize) -> Result<Vec<T>> {
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| no_memory::<T>(count))?;
    Ok(values)
}

/// A vector of `count` copies of a value; fails as [`with_room`] does.
pub(crate) fn filled<T: Clone>(count: usize, value: T) -> Result<Vec<T>> {
    let mut values = with_room(count)?;
    values.resize(count, value);
    Ok(values)
}

/// An asset without splats that has room for `count` of them.
pub(crate) fn room_for_splats(count: usize, sh_degree: u32) -> Result<SplatAsset> {
    Ok(SplatAsset {
        sh_degree,
        sh_degrees: with_room(count)?,
        positions: with_room(count)?,
        rotations: with_room(count)?,
        scales: with_room(count)?,
        opacities: with_room(count)?,
        sh: with_room(count * 3 * num_sh_coefficients(sh_degree))?,
        maps: with_room(count)?,
        ..SplatAsset::default()
    })
}

fn no_memory<T>(count: usize) -> Error {
    let bytes = count.saturating_mul(size_of::<T>());
    too_large!("", "{bytes} bytes are needed at once, more than the system provides")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    #[test]
    fn splat_bytes_match_the_arrays() {
        for degree in 0..=3 {
            let asset = fixture(10, degree);
            let bytes = size_of_val(&asset.positions[..])
                + size_of_val(&asset.rotations[..])
                + size_of_val(&asset.scales[..])
                + size_of_val(&asset.opacities[..])
                + size_of_val(&asset.sh_degrees[..])
                + size_of_val(&asset.sh[..])
                + size_of_val(&asset.maps[..]);
            assert_eq!(10 * splat_bytes(degree), bytes as u64);
        }
        assert_eq!(splat_bytes(3), 253);
    }

    #[test]
    fn impossible_allocations_are_errors() {
        assert!(matches!(with_room::<u64>(usize::MAX / 8), Err(Error::TooLarge { .. })));
        assert_eq!(filled(3, 1.5).unwrap(), [1.5; 3]);
    }

    #[test]
    fn limits_scale_with_file_size() {
        let limits = ReadLimits::default();
        assert_eq!(limits.of_file(100_000).decoded_bytes, SMALL_BYTES + 104_000_000);
        assert_eq!(limits.of_file(u64::MAX), limits);
        let tight = ReadLimits { decoded_bytes: 1000, layers: None };
        assert_eq!(tight.of_file(100_000), tight);
        // Hundreds of thousands of splats with millions of texels, and millions of splats, compressed as well as it gets.
        assert!(limits.check(2 * (200_000 * splat_bytes(3) + 12 * 16_000_000), "", Path::new("")).is_ok());
        assert!(limits.check(6_000_000 * (2 * splat_bytes(3) + 65), "", Path::new("")).is_ok());
        assert!(limits.check((1 << 24) * (splat_bytes(3) + 65), "", Path::new("")).is_err());
    }
}
