//! Folders in a capture that hold photos, for names without folders and for the message that there are none in the usual place.

use super::extensions::DEPTH_MAX;
use super::paths::may_hold_photos;
use std::collections::VecDeque;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Folders that are looked into, nearest first.
const FOLDERS_MAX: usize = 1000;

/// The folders in and including `root` that hold what is wanted; hidden ones and those of masks and the like are left out.
pub(super) fn folders(root: &Path, holds: &dyn Fn(&Path) -> bool) -> Vec<PathBuf> {
    folders_of_names(root, &may_hold_photos, holds)
}

/// The same, of folders that may be entered by their names.
pub(super) fn folders_of_names(
    root: &Path,
    may_enter: &dyn Fn(&OsStr) -> bool,
    holds: &dyn Fn(&Path) -> bool,
) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut queue = VecDeque::from([(root.to_owned(), 0)]);
    let mut num_seen = 0;
    while let Some((folder, depth)) = queue.pop_front().filter(|_| num_seen < FOLDERS_MAX) {
        num_seen += 1;
        if depth < DEPTH_MAX {
            let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
            // `file_type` does not follow links, so the walk ends.
            let inner = entries.filter(|entry| {
                entry.file_type().is_ok_and(|kind| kind.is_dir()) && may_enter(&entry.file_name())
            });
            let mut inner: Vec<PathBuf> = inner.map(|entry| entry.path()).collect();
            inner.sort();
            queue.extend(inner.into_iter().map(|inner| (inner, depth + 1)));
        }
        if holds(&folder) {
            found.push(folder);
        }
    }
    found
}
