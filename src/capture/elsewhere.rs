//! Looks for poses in the folders in and around the one that the user named, for the message that there are none here.

use super::extensions::is_read;
use super::options::CaptureFormat;
use super::paths::is_hidden;
use super::photos_near;
use super::source::first_paths;
use crate::Report;
use crate::text::shell_word;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

/// Levels of folders below the named one that are looked into.
const DEPTH_MAX: usize = 4;

/// Folders that are looked into: thousands of photos may lie in one each.
const FOLDERS_MAX: usize = 1000;

/// Where the poses are that are not in `path`, with the command that names them; `None` if there are none near.
pub(super) fn advice(path: &Path, wanted: &dyn Fn(&CaptureFormat) -> bool) -> Option<String> {
    let has_poses = |folder: &Path| {
        let mut formats = CaptureFormat::all().filter(wanted);
        formats.any(|format| (format.entry().find)(folder, &mut Report::default()).is_some())
    };
    let found = match path.is_dir() {
        true => below(path, &has_poses),
        false => Vec::new(),
    };
    let found = if found.is_empty() { above(path, &has_poses) } else { found };
    let [only] = &found[..] else {
        let command = shell_word(found.first()?);
        let folders = first_paths(&found);
        return Some(format!(
            "poses are in {} folders: {folders}; name one: litetex train {command}",
            found.len()
        ));
    };
    let images = path.join("images");
    let photos = match only.join("images").is_dir() || path.starts_with(only) {
        true => Vec::new(),
        false if images.is_dir() => vec![images],
        false => folders_of_photos(path, only),
    };
    let images = match &photos[..] {
        [] => String::new(),
        [photos] => format!(" --images {}", shell_word(photos)),
        several => format!(" --images PHOTOS, where PHOTOS is one of {}", first_paths(several)),
    };
    Some(format!("the poses are in another folder, name it: litetex train {}{images}", shell_word(only)))
}

/// The folders with photos, where none are with the poses.
fn folders_of_photos(path: &Path, poses: &Path) -> Vec<PathBuf> {
    let has_photos = |folder: &Path| {
        let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.any(|entry| is_read(&entry.path()) && !is_hidden(&entry.file_name()))
    };
    match photos_near::folders(poses, &has_photos).is_empty() {
        true => photos_near::folders(path, &has_photos),
        false => Vec::new(),
    }
}

/// The outermost folders below that have poses.
fn below(root: &Path, has_poses: &dyn Fn(&Path) -> bool) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut queue = VecDeque::from([(root.to_owned(), 0)]);
    let mut num_seen = 0;
    while let Some((folder, depth)) = queue.pop_front() {
        num_seen += 1;
        if num_seen > FOLDERS_MAX {
            break;
        }
        if depth > 0 && has_poses(&folder) {
            found.push(folder);
            continue;
        }
        if depth == DEPTH_MAX {
            continue;
        }
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        // `file_type` does not follow links, so the walk ends.
        let folders = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
        let mut folders: Vec<PathBuf> = folders.map(|entry| entry.path()).collect();
        folders.sort();
        queue.extend(folders.into_iter().map(|inner| (inner, depth + 1)));
    }
    found
}

/// The folder around if it has poses: who names the folder of the photos, or one photo, means the capture.
fn above(path: &Path, has_poses: &dyn Fn(&Path) -> bool) -> Vec<PathBuf> {
    let full = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let levels = if path.is_dir() { 1 } else { 2 };
    full.ancestors()
        .skip(1)
        .take(levels)
        .find(|folder| has_poses(folder))
        .map(Path::to_owned)
        .into_iter()
        .collect()
}
