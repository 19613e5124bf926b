//! Photos without a pose, beside those that have one.

use super::extensions;
use super::health::PhotosOnDisk;
use super::paths::{has_word_of_made, is_hidden, may_hold_photos, normal, without_extension};
use super::photo_folder::PhotoFolder;
use super::source::{Source, Why};
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::{Path, PathBuf};

/// A photo, with or without its extensions and whatever their case: its folder and its stem in lower case.
type Key = (PathBuf, String);

/// Counts the photos in the folders in which photos of views lie, and with `is_deep` in all of the photo folder. What was made
/// of a photo beside it (`a_depth.png`, `a.jpg.mask.png`, `dynamic_mask_a.png`) is none, nor are masks, hidden files, and what
/// folders of masks and the like hold; a photo in two formats is one.
pub(super) fn count(source: &Source, photos: &PhotoFolder, is_deep: bool) -> PhotosOnDisk {
    let mut posed = HashSet::<Key>::new();
    for view in &source.views {
        match &view.photo {
            Some(photo) => posed.extend([key(photo)]),
            // A name that leads out of an archive is refused where the photos are given to their views.
            None => posed.extend(photos.find(&view.name).ok().flatten().map(|photo| key(&photo))),
        }
    }
    let own: BTreeSet<PathBuf> = posed.iter().map(|(folder, _)| folder.clone()).collect();
    // Views that are left out are known by their names alone where their photos are elsewhere.
    let mut unused = HashSet::<String>::new();
    for view in source.unused.iter().filter(|v| v.why != Why::NoPose) {
        match photos.find(&view.name).ok().flatten() {
            Some(photo) => posed.extend([key(&photo)]),
            None if view.why == Why::NoPhoto => {}
            None => unused.extend([stem(Path::new(&view.name))]),
        }
    }
    let masks: HashSet<PathBuf> = source.views.iter().filter_map(|v| v.mask.as_deref()).map(normal).collect();
    let folders = if is_deep { with_folders_inside(photos.path(), &own) } else { own };
    let mut without = 0;
    for folder in &folders {
        let mut stems = BTreeMap::<String, bool>::new();
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let is_photo = extensions::is_read(&path) && !is_hidden(&entry.file_name());
            if is_photo && !path.is_dir() {
                *stems.entry(stem(&path)).or_default() |= masks.contains(&path);
            }
        }
        let is_posed =
            |stem: &str| unused.contains(stem) || posed.contains(&(folder.clone(), stem.to_owned()));
        let is_open = |(stem, is_mask): &(&String, &bool)| {
            !**is_mask && !is_posed(stem) && !is_made(stem, &is_posed, &|other| stems.contains_key(other))
        };
        without += stems.iter().filter(is_open).count();
    }
    let posed = posed.len() + unused.len();
    PhotosOnDisk { present: posed + without, posed }
}

/// Whether a stem is that of an image made of a photo: it goes on from that of a posed one, or has a word for such images
/// before or after that of any photo in the folder.
fn is_made(stem: &str, is_posed: &dyn Fn(&str) -> bool, is_there: &dyn Fn(&str) -> bool) -> bool {
    let is_of = |photo: &str, rest: &str| is_posed(photo) || (has_word_of_made(rest) && is_there(photo));
    stem.match_indices(['_', '-', '.', ' ']).any(|(at, _)| {
        let (before, after) = (&stem[..at], &stem[at + 1..]);
        is_of(before, after)
            || is_of(without_extension(before), after)
            || (has_word_of_made(before) && (is_posed(after) || is_there(after)))
    })
}

/// A folder and those in it that may hold photos or do hold posed ones.
fn with_folders_inside(root: &Path, own: &BTreeSet<PathBuf>) -> BTreeSet<PathBuf> {
    let mut found = own.clone();
    let mut open = vec![root.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            // `file_type` does not follow links, so the walk ends.
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) && may_hold_photos(&entry.file_name()) {
                open.push(entry.path());
            }
        }
        found.insert(normal(&folder));
    }
    found
}

fn key(photo: &Path) -> Key {
    // Names may lead out of the folder and back.
    (normal(photo.parent().unwrap_or(Path::new(""))), stem(photo))
}

/// The name of a file without extension, in lower case.
fn stem(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    without_extension(&name).to_lowercase()
}
