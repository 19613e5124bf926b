//! Paths that pose files hold: whether they lead out of a folder, whether something is there, and names without their
//! extension.

use crate::Result;
use crate::text::quoted;
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

/// Words, of the names of files and folders, for images that programs make of photos.
const MADE: [&str; 14] = [
    "mask",
    "masks",
    "depth",
    "depths",
    "normal",
    "normals",
    "semantic",
    "semantics",
    "segmentation",
    "alpha",
    "thumb",
    "thumbs",
    "thumbnail",
    "thumbnails",
];

/// Whether a name is of a file that macOS puts beside each file on foreign disks and in archives.
pub(crate) fn is_of_macos(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    name == "__MACOSX" || name.starts_with("._")
}

/// Whether a name has a word for images that programs make of photos.
pub(super) fn has_word_of_made(name: &str) -> bool {
    has_word(name, &MADE)
}

/// Whether a name has one of these words, in any case.
pub(super) fn has_word(name: &str, known: &[&str]) -> bool {
    let mut words = name.split(|c: char| !c.is_alphanumeric());
    words.any(|word| known.iter().any(|known| word.eq_ignore_ascii_case(known)))
}

/// Whether programs keep something of their own under this name: `.thumb`, `@eaDir`, `__MACOSX`.
pub(super) fn is_hidden(name: &OsStr) -> bool {
    is_of_macos(name) || name.to_string_lossy().starts_with(['.', '@'])
}

/// Whether photos may lie in a folder of this name: it is neither hidden nor one of masks or the like.
pub(super) fn may_hold_photos(name: &OsStr) -> bool {
    !is_hidden(name) && !has_word_of_made(&name.to_string_lossy())
}

/// A path with backslashes as one with slashes; `None` if it has none.
pub(crate) fn with_slashes(stored: &str) -> Option<String> {
    stored.contains('\\').then(|| stored.replace('\\', "/"))
}

/// A stored path without `./` and with forward slashes.
pub(crate) fn plain(stored: &str) -> String {
    let path = stored.replace('\\', "/");
    path.trim_start_matches("./").to_owned()
}

/// A name without the extension of its last part. Digits alone are none: `frame.0001` is a whole name.
pub(crate) fn without_extension(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, extension))
            if !(stem.is_empty() || stem.ends_with('/') || extension.contains('/'))
                && extension.contains(|c: char| !c.is_ascii_digit()) =>
        {
            stem
        }
        _ => name,
    }
}

/// The folders that all of these paths with slashes begin with, with the slash at their end.
pub(crate) fn common_folder<'a>(paths: impl IntoIterator<Item = &'a str>) -> &'a str {
    let folder = |path: &'a str, end: usize| path[..end].rfind('/').map_or("", |at| &path[..=at]);
    let mut paths = paths.into_iter();
    let first = paths.next().unwrap_or_default();
    paths.fold(folder(first, first.len()), |common, path| {
        let num_same = common.bytes().zip(path.bytes()).take_while(|(a, b)| a == b).count();
        if num_same == common.len() { common } else { folder(common, common.floor_char_boundary(num_same)) }
    })
}

/// Whether something lies at a path that is to be read as a photo. Devices and pipes count: whoever opens the photo
/// refuses them by name, where a view without photo would only be left out.
pub(crate) fn is_there(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| !found.is_dir())
}

/// Refuses a path that leads out of an unpacked archive.
///
/// # Errors
/// [`crate::Error::InvalidInput`], with the path as it was `stored`.
pub(crate) fn confine(root: &Path, path: &Path, stored: &str) -> Result<()> {
    if is_inside(root, path) {
        return Ok(());
    }
    Err(invalid!(
        root,
        "{} is outside the archive, which must be self-contained; unpack it if you trust it",
        quoted(stored)
    ))
}

/// Whether a path lies in a folder, by the text of both: links lead where their owner wants them to.
pub(crate) fn is_inside(folder: &Path, path: &Path) -> bool {
    normal(path).starts_with(normal(folder))
}

/// An absolute path without `.` and `..`, by its text.
pub(super) fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
        match part {
            Component::ParentDir => drop(normal.pop()),
            part => normal.push(part),
        }
    }
    normal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn common_folders_end_at_a_slash() {
        for (paths, expected) in [
            (&["a/b/c.png", "a/b/d.png"][..], "a/b/"),
            (&["a/b1/c.png", "a/b2/c.png"], "a/"),
            (&["a/b/c.png", "a/b"], "a/"),
            (&["a/\u{e4}/c", "a/\u{e5}/c"], "a/"),
            (&["a/b.png"], "a/"),
            (&["a/b.png", "c/b.png"], ""),
            (&["a.png", "a.png"], ""),
            (&[], ""),
        ] {
            assert_eq!(common_folder(paths.iter().copied()), expected, "{paths:?}");
        }
    }

    #[test]
    fn containment_is_decided_by_the_normalised_path() {
        let inside = |path: &str| is_inside(Path::new("/captures/garden"), Path::new(path));
        assert!(inside("/captures/garden/images/a.png"));
        assert!(inside("/captures/garden/images/../masks/a.png"));
        assert!(inside("/captures/garden/./a.png"));
        assert!(!inside("/captures/garden/images/../../a.png"));
        assert!(!inside("/captures/garden2/a.png"));
        assert!(!inside("/etc/passwd"));
        assert!(is_inside(Path::new("."), Path::new("./images/a.png")));
        assert!(!is_inside(Path::new("."), Path::new("../a.png")));
    }
}
