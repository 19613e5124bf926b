//! Photos and videos by the names of their files.

use std::path::Path;

pub(crate) use super::folder::is_of_macos;

/// Extensions of photos that we read, in lower case.
pub(crate) const READ: [&str; 5] = ["jpg", "jpeg", "png", "webp", "exr"];

/// Those of photos that have to be converted.
pub(crate) const CONVERTED: [&str; 5] = ["heic", "heif", "avif", "tif", "tiff"];

/// Extensions of videos, in lower case.
pub(crate) const VIDEOS: [&str; 12] =
    ["mp4", "mov", "m4v", "mkv", "avi", "webm", "mts", "m2ts", "3gp", "mpg", "mpeg", "wmv"];

/// Levels of folders in which photos are looked for.
pub(crate) const DEPTH_MAX: usize = 3;

/// Whether a file has one of these extensions, in any case.
pub(crate) fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_lowercase);
    extension.is_some_and(|e| extensions.contains(&e.as_str()))
}
