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

/// The text of a file, which must be UTF-8, or UTF-16 with a byte order mark; the mark is left out.
///
/// # Errors
/// As [`read`]; [`Error::InvalidInput`] also for bytes that are no text.
pub fn read_text(path: &Path, bytes_max: u64) -> Result<String> {
    let bytes = read(path, bytes_max)?;
    if let Some(units) = utf16(&bytes) {
        let is_whole = bytes.len().is_multiple_of(2);
        let text = String::from_utf16(&units).ok().filter(|_| is_whole);
        return text
            .ok_or_else(|| invalid!(path, "not UTF-16 text, as its byte order mark says; save it as UTF-8"));
    }
    let mut text =
        String::from_utf8(bytes).map_err(|e| invalid!(path, "not UTF-8 text: {}", e.utf8_error()))?;
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

/// The text at the beginning of a file, of which these are the first bytes; what is no text is replaced.
pub fn text_of_head(bytes: &[u8]) -> String {
    match utf16(bytes) {
        Some(units) => String::from_utf16_lossy(&units),
        None => String::from_utf8_lossy(bytes).trim_start_matches('\u{feff}').to_owned(),
    }
}

/// The units after the byte order mark of UTF-16; `None` without it.
fn utf16(bytes: &[u8]) -> Option<Vec<u16>> {
    let (unit, rest): (fn([u8; 2]) -> u16, _) = match bytes {
        [0xff, 0xfe, rest @ ..] => (u16::from_le_bytes, rest),
        [0xfe, 0xff, rest @ ..] => (u16::from_be_bytes, rest),
        _ => return None,
    };
    Some(rest.chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect())
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
    fn utf16_with_a_byte_order_mark_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.txt");
        let units: Vec<u16> = "\u{feff}\u{e4}\u{1f600}\n".encode_utf16().collect();
        for to_bytes in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes: Vec<u8> = units.iter().copied().flat_map(to_bytes).collect();
            std::fs::write(&path, &bytes).unwrap();
            assert_eq!(read_text(&path, 100).unwrap(), "\u{e4}\u{1f600}\n");
            assert_eq!(text_of_head(&bytes[..5]), "\u{e4}");
            // Negative controls: half a unit at the end, half a pair.
            for cut in [bytes.len() - 1, 6] {
                std::fs::write(&path, &bytes[..cut]).unwrap();
                assert!(read_text(&path, 100).unwrap_err().to_string().contains("not UTF-16"));
            }
        }
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
