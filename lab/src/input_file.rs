//! Reads files that the user names: only regular ones, because devices and pipes may be endless and opening a pipe may
//! block.

use crate::{Error, Result};
use std::path::Path;

/// The bytes of a regular file; links are followed.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>> {
    check(path)?;
    std::fs::read(path).map_err(|e| Error::io(path, e))
}

/// The text of a regular file.
pub(crate) fn read_text(path: &Path) -> Result<String> {
    check(path)?;
    std::fs::read_to_string(path).map_err(|e| Error::io(path, e))
}

fn check(path: &Path) -> Result<()> {
    let facts = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
    match () {
        () if facts.is_file() => Ok(()),
        () if facts.is_dir() => Err(Error::invalid(path, "a folder, expected a file")),
        () => Err(Error::invalid(path, "a device or a pipe, expected a regular file")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn pipes_and_folders_are_refused_before_they_are_opened() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for (path, what) in [(pipe.as_path(), "pipe"), (folder.path(), "a folder")] {
            for outcome in [read(path).map(drop), read_text(path).map(drop)] {
                let error = outcome.unwrap_err();
                let is_invalid = matches!(error, Error::InvalidInput { .. });
                assert!(is_invalid && error.to_string().contains(what), "{error}");
            }
        }
    }
}
