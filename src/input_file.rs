//! Reads user-supplied files whole: only regular files up to a size limit, because devices and pipes may be endless and
//! opening a pipe may block.

use crate::{Error, Result};
use std::io::ErrorKind;
use std::path::Path;

/// The bytes of a regular file of at most `bytes_max`; links are followed.
///
/// # Errors
/// [`Error::Io`], [`Error::InvalidInput`] for folders, devices and pipes, [`Error::Unsupported`] if the
/// file is larger.
pub fn read(path: &Path, bytes_max: u64) -> Result<Vec<u8>> {
    litetex_exporters::read_file(path, bytes_max).map_err(our_error)
}

/// The text of a file, which must be UTF-8; a byte order mark is left out.
///
/// # Errors
/// As [`read`]; [`Error::InvalidInput`] also for bytes that are no text.
pub fn read_text(path: &Path, bytes_max: u64) -> Result<String> {
    let mut text = String::from_utf8(read(path, bytes_max)?)
        .map_err(|e| invalid!(path, "not UTF-8 text: {}", e.utf8_error()))?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

/// Checks that there is a file or a folder.
///
/// # Errors
/// [`Error::Io`], which counts as missing.
pub fn check_exists(path: &Path) -> Result<()> {
    if path.exists() { Ok(()) } else { Err(Error::io(path, ErrorKind::NotFound.into())) }
}

/// Checks that a file may be opened by a reader that takes a path: a regular file of at most `bytes_max`.
///
/// # Errors
/// As [`read`].
pub fn check(path: &Path, bytes_max: u64) -> Result<()> {
    let size = litetex_exporters::regular_file_bytes(path).map_err(our_error)?;
    if size > bytes_max {
        return Err(unsupported!(path, "the file has {size} bytes, expected at most {bytes_max}"));
    }
    Ok(())
}

/// A folder or a device in place of a file is a mistake in the input, not a failure of the system.
fn our_error(error: litetex_exporters::Error) -> Error {
    match error.into() {
        Error::Io { path, cause }
            if matches!(cause.kind(), ErrorKind::IsADirectory | ErrorKind::InvalidInput) =>
        {
            Error::invalid(path, cause.to_string())
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_comes_without_its_byte_order_mark() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.txt");
        std::fs::write(&path, "\u{feff}a\n").unwrap();
        assert_eq!(read_text(&path, 100).unwrap(), "a\n");
        std::fs::write(&path, b"a\xff").unwrap();
        assert!(read_text(&path, 100).unwrap_err().to_string().contains("not UTF-8"));
    }

    #[test]
    fn folders_and_oversized_files_are_distinct_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.txt");
        std::fs::write(&path, "0123456789").unwrap();
        assert!(read(&path, 10).is_ok() && check(&path, 10).is_ok());
        for outcome in [read(&path, 9).map(drop), check(&path, 9)] {
            assert_eq!(outcome.unwrap_err().exit_code(), 4);
        }
        for outcome in [read(folder.path(), 9).map(drop), check(folder.path(), 9)] {
            assert_eq!(outcome.unwrap_err().exit_code(), 3);
        }
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_refused_before_they_are_opened() {
        for outcome in
            [read(Path::new("/dev/zero"), u64::MAX).map(drop), check(Path::new("/dev/zero"), u64::MAX)]
        {
            let error = outcome.unwrap_err();
            assert!(error.exit_code() == 3 && error.to_string().contains("device"), "{error}");
        }
    }
}
