//! Photos without a pose, beside those that have one.

use super::extensions;
use super::health::PhotosOnDisk;
use super::paths::{is_of_macos, without_extension};
use super::source::{Source, Why};
use std::collections::{BTreeSet, HashSet};
use std::path::Path;

/// Counts the photos in the folders in which photos of views lie. Files that are named after a posed photo (`a_depth.png`,
/// `a.jpg.png`) were made of it, and masks are none.
pub(super) fn count(source: &Source) -> PhotosOnDisk {
    let photos: Vec<&Path> = source.views.iter().filter_map(|v| v.photo.as_deref()).collect();
    let masks: HashSet<&Path> = source.views.iter().filter_map(|v| v.mask.as_deref()).collect();
    let posed: HashSet<(&Path, String)> =
        photos.iter().map(|photo| (folder_of(photo), stem(photo))).collect();
    // Views that are left out are known by their names alone.
    let unused = source.unused.iter().filter(|v| !matches!(v.why, Why::NoPose | Why::NoPhoto));
    let unused: HashSet<String> = unused.map(|v| stem(Path::new(&v.name))).collect();
    let folders: BTreeSet<&Path> = photos.iter().map(|photo| folder_of(photo)).collect();
    let mut without = 0;
    for folder in folders {
        let is_posed = |stem: &str| unused.contains(stem) || posed.contains(&(folder, stem.to_owned()));
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if !extensions::is_read(&path) || is_of_macos(&entry.file_name()) || masks.contains(&*path) {
                continue;
            }
            let stem = stem(&path);
            let is_made_of_posed =
                || stem.match_indices(['_', '-', '.']).any(|(at, _)| is_posed(&stem[..at]));
            without += usize::from(!is_posed(&stem) && !is_made_of_posed());
        }
    }
    let posed = posed.len() + unused.len();
    PhotosOnDisk { present: posed + without, posed }
}

fn folder_of(photo: &Path) -> &Path {
    photo.parent().unwrap_or(Path::new(""))
}

/// The name of a file without extension, in lower case.
fn stem(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    without_extension(&name).to_lowercase()
}
