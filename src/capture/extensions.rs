//! The extensions of photos: those that are read, those of photos that have to be converted, and those that only tell a
//! name with an extension from one without.

use std::path::Path;

/// Of photos that are read, in lower case. Of several files for one name, the extension that comes first is taken.
pub(crate) const READ: [&str; 5] = ["png", "jpg", "jpeg", "exr", "webp"];

/// Of photos that have to be converted.
pub(crate) const CONVERTED: [&str; 5] = ["heic", "heif", "avif", "tif", "tiff"];

/// Of videos, in lower case.
pub(crate) const VIDEOS: [&str; 12] =
    ["mp4", "mov", "m4v", "mkv", "avi", "webm", "mts", "m2ts", "3gp", "mpg", "mpeg", "wmv"];

/// Levels of folders in which photos are looked for.
pub(crate) const DEPTH_MAX: usize = 3;

/// Of other images that poses may name.
const OTHER: [&str; 24] = [
    "jpe", "jfif", "jp2", "jxl", "bmp", "gif", "tga", "hdr", "ppm", "pgm", "pnm", "dng", "cr2", "cr3", "nef",
    "arw", "raf", "orf", "rw2", "pef", "srw", "raw", "insp", "mpo",
];

/// Whether a file has one of these extensions, in any case.
pub(crate) fn is_of(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|e| extensions.iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Whether a file is a photo that is read.
pub(crate) fn is_read(path: &Path) -> bool {
    is_of(path, &READ)
}

/// Whether a file is a photo, which may have to be converted.
pub(crate) fn is_photo(path: &Path) -> bool {
    is_read(path) || is_of(path, &CONVERTED)
}

/// Whether a name ends in the extension of an image, so that it is whole: `a.jpg.png` is no photo of `a.jpg`, but the
/// mask of that photo as COLMAP names it.
pub(crate) fn is_whole(name: &str) -> bool {
    is_photo(Path::new(name)) || is_of(Path::new(name), &OTHER)
}
