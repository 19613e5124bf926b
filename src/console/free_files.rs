//! Checks the names of files to be written before any work is done.

use crate::{Result, atomic_file};
use std::path::PathBuf;

/// Refuses files that exist, unless they may be replaced, and anything else in their place: folders, devices, pipes.
///
/// # Errors
/// [`crate::Error::Usage`] naming the first of them.
pub fn check_free(files: &[PathBuf], force: bool) -> Result<()> {
    files.iter().try_for_each(|file| atomic_file::check_place(file))?;
    let taken: Vec<&PathBuf> =
        files.iter().filter(|file| !force && file.symlink_metadata().is_ok()).collect();
    let Some(first) = taken.first() else { return Ok(()) };
    let what = match taken.len() {
        1 => "exists already; --force replaces it".to_owned(),
        n => format!("exists already, as do {} more of the files to write; --force replaces them", n - 1),
    };
    Err(usage!("{}: {what}", first.display()))
}
