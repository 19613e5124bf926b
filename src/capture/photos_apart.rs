//! The folder that holds the photos of a capture where they are not in the usual one: what to give `--images`.

use super::folder::CaptureFolder;
use super::photos_near;
use super::source::first_of;
use crate::text::shell_word;
use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Views whose photos are looked for: those of a few are proof enough.
const NUM_ASKED: usize = 50;

/// Step from one name asked for to the next, modulo their number, of which this prime is no divisor: names at even distances
/// may all be of one camera of several.
const STEP: usize = 1_000_003;

/// The folder inside that holds most photos of these names, and more than half of those asked for, with the others if there
/// are several; a blank before it, nothing if there is none.
pub(super) fn hint(folder: &CaptureFolder, names: &[&str]) -> String {
    let asked = (0..names.len().min(NUM_ASKED)).map(|index| names[index * STEP % names.len()]);
    let asked: Vec<&str> = asked.collect();
    let inside = |found: &Path| found.strip_prefix(&folder.root).unwrap_or(found).to_owned();
    let fit = |found: &Path| {
        let photos = folder.photos(&inside(found).to_string_lossy());
        let matches: Vec<_> = asked.iter().filter_map(|name| photos.find(name).ok().flatten()).collect();
        // Of several that would share a photo, none gets it.
        let files: BTreeSet<&Path> = matches.iter().map(|photo| &*photo.path).collect();
        (files.len(), Reverse(matches.iter().map(|photo| photo.misfit.folders).sum::<usize>()))
    };
    let folders = photos_near::folders(&folder.root, &|_| true);
    let fitting: Vec<_> = folders.into_iter().map(|found| (fit(&found), found)).collect();
    let Some(best) = fitting.iter().map(|(fit, _)| *fit).max().filter(|best| 2 * best.0 > asked.len()) else {
        return String::new();
    };
    let found: Vec<PathBuf> =
        fitting.into_iter().filter(|(fit, _)| *fit == best).map(|(_, found)| found).collect();
    let is_inmost = |path: &&PathBuf| !found.iter().any(|other| other != *path && other.starts_with(path));
    let found = found.iter().filter(is_inmost).map(|found| inside(found));
    let words: Vec<String> = found
        .map(|found| if found.as_os_str().is_empty() { PathBuf::from(".") } else { found })
        .map(|found| shell_word(&found))
        .collect();
    match &words[..] {
        [] => String::new(),
        [only] => format!(" {only}"),
        [first, others @ ..] => format!(" {first} (or {})", first_of(others.iter().cloned())),
    }
}
