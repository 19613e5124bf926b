//! Packages (`.usdz`): zip archives whose entries are stored uncompressed, each at a multiple of 64 bytes.

use crate::{ReadLimits, Result, quoted};
use std::io::{Cursor, Read, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

/// The data of entries begin at multiples of this.
const ALIGNMENT: u16 = 64;

/// Most entries that a package may have.
const ENTRIES_MAX: usize = 1000;

/// A file in a package.
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) bytes: Vec<u8>,
}

/// Encodes a package; the first entry is its root layer. Equal entries make equal bytes, because times are fixed.
///
/// # Errors
/// [`crate::Error::Invalid`] with the message of the zip writer.
pub(super) fn package_from_entries(entries: Vec<Entry>) -> Result<Vec<u8>> {
    let failed = |what: String| invalid!("", "package: {what}");
    // With room for alignment and directory.
    let room = entries.iter().map(|e| e.bytes.len() + 2 * e.name.len() + 512).sum();
    let mut writer = ZipWriter::new(Cursor::new(Vec::with_capacity(room)));
    for entry in entries {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::default())
            .unix_permissions(0o644)
            .large_file(entry.bytes.len() >= u32::MAX as usize)
            .with_alignment(ALIGNMENT);
        writer.start_file(&entry.name, options).map_err(|e| failed(e.to_string()))?;
        writer.write_all(&entry.bytes).map_err(|e| failed(e.to_string()))?;
    }
    Ok(writer.finish().map_err(|e| failed(e.to_string()))?.into_inner())
}

/// Decodes the entries of a package; `path` is only for messages.
///
/// # Errors
/// [`crate::Error::Invalid`] if it is damaged or breaks the rules of packages, [`crate::Error::TooLarge`].
pub(super) fn entries_from_package(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Vec<Entry>> {
    let damaged = |what: String| invalid!(path, "package: {what}");
    check_directory(bytes, path)?;
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| damaged(e.to_string()))?;
    if archive.len() > ENTRIES_MAX {
        return Err(too_large!(path, "{} entries, at most {ENTRIES_MAX}", archive.len()));
    }
    let mut entries = Vec::new();
    let mut total = 0_u64;
    for index in 0..archive.len() {
        // Raw, because compressed entries are refused, not decompressed.
        let file = archive.by_index_raw(index).map_err(|e| damaged(e.to_string()))?;
        let name = file.name().map_err(|e| damaged(e.to_string()))?.into_owned();
        let invalid = |what: &str| Err(damaged(format!("entry {}: {what}", quoted(&name))));
        if !is_plain_path(&name) {
            return invalid("not a plain relative path");
        }
        if file.compression() != CompressionMethod::Stored || file.encrypted() || file.is_symlink() {
            return invalid("compressed, encrypted or a link; packages hold only stored files");
        }
        if file.data_start().is_none_or(|at| at % u64::from(ALIGNMENT) != 0) {
            return invalid("its data are not at a multiple of 64 bytes");
        }
        total = total.saturating_add(file.size());
        // Overlapping entries could add up to many times the file.
        if file.size() != file.compressed_size() || total > bytes.len() as u64 || total > limits.decoded_bytes
        {
            return invalid("larger than the package");
        }
        let (size, crc) = (file.size(), file.crc32());
        let mut data = Vec::new();
        file.take(size)
            .read_to_end(&mut data)
            .map_err(|e| damaged(format!("entry {}: {e}", quoted(&name))))?;
        if data.len() as u64 != size || crc32(&data) != crc {
            return invalid("truncated or damaged (its checksum differs)");
        }
        entries.push(Entry { name, bytes: data });
    }
    Ok(entries)
}

/// Refuses archives that claim too many entries, before a table is allocated for them.
fn check_directory(bytes: &[u8], path: &Path) -> Result<()> {
    const END: [u8; 4] = *b"PK\x05\x06";
    const END_BYTES: usize = 22;
    /// Precedes the end in archives of more than 65,535 entries or 4 GiB.
    const LOCATOR: [u8; 4] = *b"PK\x06\x07";
    const LOCATOR_BYTES: usize = 20;
    let tail = bytes.len().saturating_sub(END_BYTES + usize::from(u16::MAX));
    let ends = (tail..bytes.len()).filter(|&at| bytes[at..].starts_with(&END));
    for at in ends {
        let count = bytes.get(at + 10..).and_then(<[u8]>::first_chunk).map_or(0, |b| u16::from_le_bytes(*b));
        let is_large = bytes.len() > u32::MAX as usize;
        let locator = at.checked_sub(LOCATOR_BYTES).and_then(|at| bytes.get(at..));
        let has_locator = !is_large && locator.is_some_and(|b| b.starts_with(&LOCATOR));
        if (usize::from(count) > ENTRIES_MAX && !is_large) || has_locator {
            return Err(too_large!(path, "a package of more than {ENTRIES_MAX} entries"));
        }
    }
    Ok(())
}

/// Whether a path is relative, without `.` and `..`, without a drive or a scheme.
pub(super) fn is_plain_path(path: &str) -> bool {
    !path.contains(['\\', ':', '\0'])
        && path.split('/').all(|part| !part.is_empty() && part != "." && part != "..")
}

/// The checksum of zip archives: the reflected polynomial 0xEDB88320, four bits at a time.
pub(super) fn crc32(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 16] = {
        let mut table = [0; 16];
        let mut i = 0;
        while i < 16 {
            let (mut value, mut bit) = (i as u32, 0);
            while bit < 4 {
                value = if value & 1 == 1 { value >> 1 ^ 0xedb8_8320 } else { value >> 1 };
                bit += 1;
            }
            table[i] = value;
            i += 1;
        }
        table
    };
    let step = |crc: u32, nibble: u32| crc >> 4 ^ TABLE[((crc ^ nibble) & 15) as usize];
    !bytes.iter().fold(u32::MAX, |crc, &b| step(step(crc, b.into()), u32::from(b) >> 4))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries() -> Vec<Entry> {
        [("scene.usdc", 100), ("textures/page0.png", 77), ("textures/page1.png", 0)]
            .map(|(name, n)| Entry { name: name.into(), bytes: (0..n).map(|i| i as u8).collect() })
            .into()
    }

    #[test]
    fn entries_are_stored_aligned_and_round_trip() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
        let bytes = package_from_entries(entries()).unwrap();
        assert_eq!(package_from_entries(entries()).unwrap(), bytes, "reproducible");
        let read = entries_from_package(&bytes, Path::new("p"), &ReadLimits::default()).unwrap();
        for (read, written) in read.iter().zip(entries()) {
            assert_eq!((&read.name, &read.bytes), (&written.name, &written.bytes));
        }
        let at = bytes.windows(4).position(|w| w == [0, 1, 2, 3]).unwrap();
        assert_eq!(at % 64, 0);
        // Damage in data is seen.
        let mut damaged = bytes.clone();
        damaged[at + 5] ^= 1;
        assert!(entries_from_package(&damaged, Path::new("p"), &ReadLimits::default()).is_err());
        for cut in 0..bytes.len() {
            assert!(entries_from_package(&bytes[..cut], Path::new("p"), &ReadLimits::default()).is_err());
        }
    }

    #[test]
    fn names_outside_the_package_are_refused() {
        for name in ["/etc/passwd", "../a.png", "a/../b", "C:/a", "a\\b", "", "a//b", "./a", "http://a"] {
            assert!(!is_plain_path(name), "{name}");
        }
        assert!(is_plain_path("textures/page 0.png"));
        let evil = [Entry { name: "../scene.usdc".into(), bytes: vec![1] }];
        let bytes = package_from_entries(evil.into()).unwrap();
        assert!(entries_from_package(&bytes, Path::new("p"), &ReadLimits::default()).is_err());
    }
}
