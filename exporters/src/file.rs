//! Files that appear whole or not at all.

use std::io::Result;
use std::path::Path;

/// Writes a file under a temporary name beside its place and renames it, so that no reader and no
/// interruption ever meets half a file.
///
/// # Errors
/// The operating system's; the temporary file is removed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = path.with_file_name(name);
    std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path)).inspect_err(|_| {
        // The first error is the one that matters.
        let _ = std::fs::remove_file(&temporary);
    })
}
