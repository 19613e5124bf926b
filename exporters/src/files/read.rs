//! Reads files up to a size limit.

use crate::{Error, Result};
use std::fs::File;
use std::io::{ErrorKind, Read as _};
use std::path::Path;

/// Reads a regular file of at most `bytes_max` bytes; links are followed.
///
/// # Errors
/// [`Error::Io`], also for folders, pipes and devices, which may be endless; [`Error::TooLarge`].
pub fn read_file(path: &Path, bytes_max: u64) -> Result<Vec<u8>> {
    let size = regular_file_bytes(path)?;
    let too_large = |why: &str| Err(too_large!(path, "a file of {size} bytes, {why}"));
    if size > bytes_max {
        return too_large(&format!("at most {bytes_max} are read"));
    }
    let mut bytes = Vec::new();
    if bytes.try_reserve_exact(usize::try_from(size).unwrap_or(usize::MAX)).is_err() {
        return too_large("more than the memory can hold");
    }
    // What is appended meanwhile is not read.
    let read = File::open(path).and_then(|file| file.take(size).read_to_end(&mut bytes));
    read.map_err(|e| Error::io(path, e))?;
    Ok(bytes)
}

/// Reads the first bytes of a regular file, or all if it is shorter.
///
/// # Errors
/// [`Error::Io`] as [`read_file`].
pub(crate) fn read_head(path: &Path, num_bytes: u64) -> Result<Vec<u8>> {
    let size = regular_file_bytes(path)?;
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(size.min(num_bytes)).read_to_end(&mut bytes));
    read.map_err(|e| Error::io(path, e))?;
    Ok(bytes)
}

/// Size of a regular file; links are followed. Others are refused before they are opened: opening a pipe may block.
///
/// # Errors
/// [`Error::Io`], also for folders, pipes and devices.
pub fn regular_file_bytes(path: &Path) -> Result<u64> {
    let facts = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
    let refused = |kind, what: &str| Err(Error::io(path, std::io::Error::new(kind, what)));
    match () {
        () if facts.is_file() => Ok(facts.len()),
        () if facts.is_dir() => refused(ErrorKind::IsADirectory, "a folder, expected a file"),
        () => refused(ErrorKind::InvalidInput, "a device or a pipe, expected a regular file"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reading_stops_at_the_size_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, b"0123456789").unwrap();
        assert_eq!(read_file(&path, 10).unwrap(), b"0123456789");
        assert_eq!(read_head(&path, 3).unwrap(), b"012");
        assert_eq!(read_head(&path, 30).unwrap().len(), 10);
        let error = read_file(&path, 9).unwrap_err();
        assert!(matches!(&error, Error::TooLarge { .. }), "{error}");
        assert!(error.to_string().contains("10 bytes") && error.to_string().contains("at most 9"), "{error}");
        // Sparse on disk, but reading it would fill memory.
        File::options().write(true).open(&path).unwrap().set_len(20 << 30).unwrap();
        assert!(matches!(read_file(&path, 8 << 30), Err(Error::TooLarge { .. })));
        for (path, word) in [(folder.path(), "folder"), (&folder.path().join("none"), "")] {
            let error = read_file(path, 10).unwrap_err();
            assert!(matches!(&error, Error::Io { .. }) && error.to_string().contains(word), "{error}");
            assert!(matches!(read_head(path, 10), Err(Error::Io { .. })));
        }
    }

    #[cfg(unix)]
    #[test]
    fn endless_files_are_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("scene.ltgs");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        let error = read_file(&link, u64::MAX).unwrap_err();
        assert!(matches!(&error, Error::Io { .. }) && error.to_string().contains("device"), "{error}");
        assert!(matches!(read_head(&link, 4), Err(Error::Io { .. })));
    }
}
