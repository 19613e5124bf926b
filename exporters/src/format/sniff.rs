//! Recognises formats by their first bytes, so that a misnamed file is reported as misnamed, not as damaged.

use crate::files::read::read_head;
use crate::{Error, Format, Result};
use std::path::Path;

/// Bytes to look at: white space may precede JSON and HTML.
const HEAD_BYTES: u64 = 512;

/// Bytes of an unknown file to show in the message.
const SHOWN_BYTES: usize = 8;

/// First bytes, the format that they mark, and what to call it.
const MAGICS: [(&[u8], Format, &str); 12] = [
    (b"glTF", Format::Glb, "binary glTF"),
    (b"LTGS", Format::Ltgs, "compact textured splats"),
    (b"<!doctype html", Format::Html, "HTML"),
    (b"<html", Format::Html, "HTML"),
    (b"#usda", Format::Usda, "OpenUSD text"),
    (b"PXR-USDC", Format::Usdc, "OpenUSD binary"),
    (b"PK\x03\x04", Format::Usdz, "zip archive"),
    (b"PK\x05\x06", Format::Usdz, "empty zip archive"),
    (b"ply\n", Format::Ply, "PLY"),
    (b"ply\r", Format::Ply, "PLY"),
    (b"NGSP", Format::Spz, "SPZ of version 4 or later"),
    (b"\x1f\x8b", Format::Spz, "gzip, as SPZ up to version 3"),
];

/// The format that these first bytes mark, and what to call it.
fn format_of(head: &[u8]) -> Option<(Format, &'static str)> {
    // Some programs write a byte order mark first.
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let is_marked = |magic: &[u8], format| match format {
        Format::Html => text.get(..magic.len()).is_some_and(|start| start.eq_ignore_ascii_case(magic)),
        _ => head.starts_with(magic),
    };
    let known = MAGICS.iter().find(|(magic, format, _)| is_marked(magic, *format));
    let is_json = text.starts_with(b"{");
    known.map(|&(_, format, name)| (format, name)).or_else(|| is_json.then_some((Format::Gltf, "JSON")))
}

/// Checks that a file begins as its format requires.
///
/// # Errors
/// [`Error::Invalid`] saying what the file is instead, [`Error::Io`] if it cannot be read.
pub(crate) fn check(path: &Path, format: Format) -> Result<()> {
    let head = read_head(path, HEAD_BYTES)?;
    let what = match format_of(&head) {
        Some((found, _)) if found == format => return Ok(()),
        Some((found, name)) => {
            format!("this is a .{} file ({name}) named .{}; rename it", found.extension(), format.extension())
        }
        None if head.is_empty() => "the file is empty".to_owned(),
        None => {
            let shown = head.get(..SHOWN_BYTES).unwrap_or(&head).escape_ascii();
            format!(
                "neither a .{} file nor of another known format: it begins with \"{shown}\"",
                format.extension()
            )
        }
    };
    Err(Error::invalid(path, what))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadLimits, read_asset, validate_file};

    /// A file's first bytes for each format.
    fn head_of(format: Format) -> &'static [u8] {
        match format {
            Format::Gltf => b" \n{\"asset\": {}}",
            _ => MAGICS.iter().find(|m| m.1 == format).unwrap().0,
        }
    }

    #[test]
    fn every_misnamed_format_is_reported_as_misnamed() {
        let folder = tempfile::tempdir().unwrap();
        for real in Format::ALL {
            for named in Format::ALL {
                let path = folder.path().join(format!("file.{}", named.extension()));
                std::fs::write(&path, head_of(real)).unwrap();
                let error = read_asset(&path, &ReadLimits::default()).unwrap_err();
                let is_told = error.to_string().contains("rename it");
                assert_eq!(is_told, real != named, "{error}");
                let issues = validate_file(&path).unwrap();
                assert!(!issues.is_empty());
                assert_eq!(issues.iter().any(|i| i.code == "LT9004"), real != named, "{issues:?}");
                if real != named {
                    let expected = format!("this is a .{} file", real.extension());
                    let message = error.to_string();
                    assert!(
                        matches!(error, Error::Invalid { .. }) && message.contains(&expected),
                        "{message}"
                    );
                    assert!(message.contains(&format!("named .{}", named.extension())), "{message}");
                    assert_eq!(issues.len(), 1, "{issues:?}");
                }
            }
        }
    }

    #[test]
    fn the_first_bytes_of_unknown_files_are_shown() {
        let folder = tempfile::tempdir().unwrap();
        for format in Format::ALL {
            let path = folder.path().join(format!("file.{}", format.extension()));
            for (bytes, word) in
                [(b"\x89PNG\r\n\x1a\n...".as_slice(), r#""\x89PNG\r\n\x1a\n""#), (b"", "empty")]
            {
                std::fs::write(&path, bytes).unwrap();
                let error = read_asset(&path, &ReadLimits::default()).unwrap_err();
                assert!(
                    matches!(error, Error::Invalid { .. }) && error.to_string().contains(word),
                    "{error}"
                );
            }
        }
        // Gzip passes as SPZ, and its reader tells what is wrong with it.
        let path = folder.path().join("cut.spz");
        std::fs::write(&path, b"\x1f\x8b\x08").unwrap();
        let error = read_asset(&path, &ReadLimits::default()).unwrap_err();
        assert!(matches!(error, Error::Invalid { .. }) && error.to_string().contains("gzip"), "{error}");
    }
}
