//! Masks that lie where none are looked for unless `masks` names the place.

use super::folder::CaptureFolder;
use super::paths::{has_word, is_hidden, normal};
use super::photo_folder::PhotoFolder;
use super::photos_near;
use super::source::SourceView;
use crate::Report;
use crate::text::{self, shell_word};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Words in the names of masks and of folders of masks.
const WORDS: [&str; 8] =
    ["mask", "masks", "matte", "mattes", "segmentation", "segmentations", "alpha", "alphas"];

/// Names the folder with most masks of the views of a capture that uses none.
pub(super) fn warn(folder: &CaptureFolder, photos: &PhotoFolder, views: &[SourceView], report: &mut Report) {
    let own: HashSet<PathBuf> = views.iter().map(|view| normal(view.photo_path())).collect();
    let is_of_masks = |path: &Path| {
        path != folder.root && path.file_name().is_some_and(|name| has_word(&name.to_string_lossy(), &WORDS))
    };
    let mut places = photos_near::folders_of_names(&folder.root, &|name| !is_hidden(name), &is_of_masks);
    // Beside photos, only what is called a mask is one.
    places.push(photos.path().to_owned());
    places.extend(views.first().and_then(|view| view.photo_path().parent()).map(Path::to_owned));
    let mut seen = HashSet::new();
    places.retain(|place| seen.insert(normal(place)));
    let count = |place: &PathBuf| {
        let masks = PhotoFolder { path: place.clone(), is_deep: *place != folder.root, ..photos.clone() };
        let is_mask = |view: &&SourceView| {
            let found = masks.find_mask(&view.name, &|path| own.contains(&normal(path))).ok().flatten();
            found.is_some_and(|found| is_of_masks(place) || is_called_mask(&found))
        };
        views.iter().filter(is_mask).count()
    };
    // Of equals, the first.
    let counted = places.into_iter().map(|place| (count(&place), place)).rev();
    if let Some((count, place)) = counted.max_by_key(|(count, _)| *count).filter(|(count, _)| *count > 0) {
        let inside = place.strip_prefix(&folder.root).unwrap_or(&place);
        let inside = shell_word(if inside.as_os_str().is_empty() { Path::new(".") } else { inside });
        let what = format!(
            "masks of {count} of {} views in {} are not used; --set capture.masks={inside} (inspect: --masks {inside}) uses them",
            views.len(),
            text::path(&place),
        );
        report.warn("masks-beside-not-used", count, what);
    }
}

/// Whether a file is called a mask: `a_mask.png`, or `a.jpg.png` as COLMAP calls them.
fn is_called_mask(file: &Path) -> bool {
    let stem = file.file_stem().unwrap_or_default();
    has_word(&stem.to_string_lossy(), &WORDS) || super::extensions::is_read(Path::new(stem))
}
