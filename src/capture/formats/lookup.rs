//! Pose files whose names are not fixed, and the photos of those that name them by a label: a name without extension, or
//! a path on another computer.

use crate::Result;
use crate::capture::folder::CaptureFolder;
use crate::capture::photo_folder::{Match, PhotoFolder};
use crate::capture::source::{Source, Why};
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Levels of folders in which pose files are looked for.
const DEPTH_MAX: usize = 3;

/// The files with an extension, in either case, in a folder and `depth` levels of folders in it; sorted.
pub(crate) fn files(folder: &Path, extension: &str, depth: usize) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for path in std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
        if path.is_dir() {
            if depth > 0 {
                found.extend(files(&path, extension, depth.min(DEPTH_MAX) - 1));
            }
        } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Whether the first bytes of a regular file hold all of these texts.
pub(crate) fn begins_with_all(path: &Path, texts: &[&str]) -> bool {
    // The longest preamble of the formats: attributes of other programs in a sidecar file.
    const HEAD_BYTES: u64 = 1 << 20;
    let mut head = Vec::new();
    let is_read = path.is_file()
        && File::open(path).is_ok_and(|file| file.take(HEAD_BYTES).read_to_end(&mut head).is_ok());
    let head = String::from_utf8_lossy(&head);
    is_read && texts.iter().all(|text| head.contains(text))
}

/// The folder that `--images` names, or the first of these that exists in the capture, or the capture's own.
pub(crate) fn photo_folder(folder: &CaptureFolder, usual: &[&str]) -> PhotoFolder {
    let inside = usual.iter().find(|name| folder.root.join(name).is_dir()).copied();
    folder.images.clone().unwrap_or_else(|| folder.photos(inside.unwrap_or_default()))
}

/// The photo of a label and its name in the folder; a label without folders may be that of the only such photo in those inside.
///
/// # Errors
/// As [`PhotoFolder::find`].
pub(crate) fn find(photos: &PhotoFolder, label: &str) -> Result<Option<(String, Match)>> {
    let path = label.replace('\\', "/");
    // Paths on another computer, with a drive or a root, are none of this one.
    let inside = path.split_once(":/").map_or(path.as_str(), |(_, inside)| inside);
    let inside = inside.trim_start_matches(['/', '.']);
    let found = photos.find(inside)?.or_else(|| photos.find_below(inside).filter(|_| !inside.contains('/')));
    Ok(found.map(|photo| (name_in(photos, &photo), Match { asked: label.to_owned(), ..photo })))
}

/// An error if none of the posed photos is there; `remedy` says what to do.
///
/// # Errors
/// See above.
pub(crate) fn require_photos(source: &Source, photos: &PhotoFolder, remedy: &str) -> Result<()> {
    match source.names_unused(Why::NoPhoto).first().filter(|_| source.views.is_empty()) {
        Some(first) => Err(invalid!(photos.path(), "no photos, expected {first}.jpg and others; {remedy}")),
        None => Ok(()),
    }
}

/// The name of a photo relative to its folder, with forward slashes.
pub(crate) fn name_in(photos: &PhotoFolder, photo: &Path) -> String {
    photo.strip_prefix(photos.path()).unwrap_or(photo).to_string_lossy().replace('\\', "/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_may_lack_an_extension_or_be_paths_on_another_computer() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("images/day")).unwrap();
        std::fs::write(folder.path().join("images/day/a.1.jpg"), b"").unwrap();
        std::fs::write(folder.path().join("b.png"), b"").unwrap();
        let capture = CaptureFolder::new(folder.path(), None, false).unwrap();
        let found = |usual: &[&str], label: &str| find(&photo_folder(&capture, usual), label).unwrap();
        for label in
            ["day/a.1", "day/a.1.jpg", "/home/user/day/a.1.JPG", "C:\\photos\\day\\a.1.jpg", "../day/a.1"]
        {
            assert!(
                found(&["photos", "images"], label).is_some_and(|(name, _)| name == "day/a.1.jpg"),
                "{label}"
            );
        }
        assert!(found(&["images"], "b.png").is_none() && found(&[], "b").is_some(), "the folder counts");
        assert!(found(&["images"], "").is_none() && found(&["images"], "/").is_none());
        std::fs::create_dir_all(folder.path().join("images/masks")).unwrap();
        std::fs::write(folder.path().join("images/masks/a.1.png"), b"").unwrap();
        let names = ["a.1", "A.1.JPG"].map(|label| found(&["images"], label).map(|(name, _)| name));
        assert!(names.iter().all(|name| name.as_deref() == Some("day/a.1.jpg")), "{names:?}");
        std::fs::create_dir_all(folder.path().join("images/night")).unwrap();
        std::fs::write(folder.path().join("images/night/a.1.jpg"), b"").unwrap();
        let capture = CaptureFolder::new(folder.path(), None, false).unwrap();
        assert_eq!(find(&capture.photos("images"), "a.1").unwrap(), None, "either may be meant");
        let archive = CaptureFolder::new(folder.path(), None, true).unwrap();
        assert!(find(&archive.photos("images"), "x/../../../etc/hosts").is_err(), "archives stay closed");
    }
}
