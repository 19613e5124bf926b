//! Pose files whose names are not fixed, and the photos of those that name them by a label: a name without extension, or
//! a path on another computer.

use crate::capture::folder::CaptureFolder;
use crate::capture::photo_folder::{Match, PhotoFolder};
use crate::capture::photos_apart;
use crate::capture::source::{Source, Why, first_of};
use crate::text;
use crate::{Report, Result, input_file};
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

/// The pose file with the most cameras; warns of the others.
pub(crate) fn largest(
    mut files: Vec<PathBuf>,
    num_cameras: impl Fn(&Path) -> usize,
    report: &mut Report,
) -> Option<PathBuf> {
    if files.len() > 1 {
        let counts: Vec<usize> = files.iter().map(|file| num_cameras(file)).collect();
        // Of equals, the first.
        let best = (0..files.len()).rev().max_by_key(|&index| counts[index]).unwrap_or(0);
        let others = (0..files.len()).filter(|&index| index != best);
        let what = format!(
            "{} pose files; using {} ({} cameras), ignoring {}; to use another, name the file in place of the folder",
            files.len(),
            text::path(&files[best]),
            counts[best],
            first_of(others.map(|index| format!("{} ({})", text::path(&files[index]), counts[index])))
        );
        report.warn("several-pose-files", files.len() - 1, what);
        return Some(files.swap_remove(best));
    }
    files.pop()
}

/// Whether the first bytes of a regular file hold all of these texts.
pub(crate) fn begins_with_all(path: &Path, texts: &[&str]) -> bool {
    // The longest preamble of the formats: attributes of other programs in a sidecar file.
    const HEAD_BYTES: u64 = 1 << 20;
    let mut head = Vec::new();
    let is_read = path.is_file()
        && File::open(path).is_ok_and(|file| file.take(HEAD_BYTES).read_to_end(&mut head).is_ok());
    let head = input_file::text_of_head(&head);
    is_read && texts.iter().all(|text| head.contains(text))
}

/// The folder that `--images` names, or the first of these that exists in the capture, or the capture's own.
pub(crate) fn photo_folder(folder: &CaptureFolder, usual: &[&str]) -> PhotoFolder {
    let inside = usual.iter().find(|name| folder.root.join(name).is_dir()).copied();
    folder.images.clone().unwrap_or_else(|| folder.photos(inside.unwrap_or_default()))
}

/// The photo of a label and its name in the folder; labels without folders are looked for in those inside.
///
/// # Errors
/// As [`PhotoFolder::find`].
pub(crate) fn find(photos: &PhotoFolder, label: &str) -> Result<Option<(String, Match)>> {
    let path = label.replace('\\', "/");
    // Paths on another computer, with a drive or a root, are none of this one.
    let inside = path.split_once(":/").map_or(path.as_str(), |(_, inside)| inside);
    let inside = inside.trim_start_matches(['/', '.']);
    let photos = PhotoFolder { is_deep: true, ..photos.clone() };
    let found = photos.find(inside)?;
    Ok(found.map(|photo| (name_in(&photos, &photo), Match { asked: label.to_owned(), ..photo })))
}

/// An error if none of the posed photos is there, with the folder that has them, or else a remedy.
///
/// # Errors
/// See above.
pub(crate) fn require_photos(
    folder: &CaptureFolder,
    source: &Source,
    photos: &PhotoFolder,
    remedy: &str,
) -> Result<()> {
    let missing = source.names_unused(Why::NoPhoto);
    let Some(first) = missing.first().filter(|_| source.views.is_empty()) else { return Ok(()) };
    let remedy = match &*photos_apart::hint(folder, &missing) {
        "" => remedy.to_owned(),
        hint => format!("name their folder with --images{hint}"),
    };
    Err(invalid!(photos.path(), "no photos, expected {first}.jpg and others; {remedy}"))
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
