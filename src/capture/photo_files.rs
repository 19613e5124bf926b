//! The photos and masks of the views of a capture: which file belongs to which, and which views have none.

use super::claims;
use super::folder::CaptureFolder;
use super::masks_apart;
use super::options::LoadOptions;
use super::paths::{is_inside, is_there, normal};
use super::photo_folder::{Match, PhotoFolder};
use super::photos_apart;
use super::source::{Source, SourceView, UnusedView, Why, first_names, first_paths};
use crate::text::{self, quoted, shell_word};
use crate::{Report, Result};
use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

/// The folder of the photos, which must exist unless the pose file names every photo.
pub(super) fn photo_folder(folder: &CaptureFolder, source: &Source) -> Result<PhotoFolder> {
    if let Some(images) = &folder.images {
        return Ok(images.clone());
    }
    let images = folder.root.join("images");
    if images.is_dir() {
        return Ok(folder.photos("images"));
    }
    let beside = folder.photos("");
    for view in &source.views {
        if view.photo.is_some() || beside.find(&view.name)?.is_some() {
            return Ok(beside);
        }
    }
    let mut posed: Vec<&str> = source.views.iter().map(|v| v.name.as_str()).collect();
    posed.extend(source.names_unused(Why::NoPhoto));
    // Photos beside the folder of the poses, as many projects keep them.
    let around = folder.root.canonicalize().ok().and_then(|root| Some(root.parent()?.join("images")));
    let named = match around.filter(|images| images.is_dir()) {
        Some(images) => format!("name the folder with --images {}", shell_word(&images)),
        None => format!("name the folder with --images{}", photos_apart::hint(folder, &posed)),
    };
    Err(invalid!(
        images,
        "no folder of photos; expected photos such as {} there: {named}",
        quoted(posed.first().unwrap_or(&"0001.jpg"))
    ))
}

/// Leaves photos to the views that they belong to; the others have none.
pub(super) fn settle(source: &mut Source, report: &mut Report) {
    let total = source.num_posed();
    let (views, claims): (Vec<usize>, Vec<&Match>) =
        source.views.iter().enumerate().filter_map(|(v, view)| Some((v, view.photo.as_ref()?))).unzip();
    let losers = claims::losers(&claims);
    if losers.is_empty() {
        return;
    }
    let what = format!(
        "{} of {total} views are left out, since their photos belong to others: {}; rename the photos or the views",
        losers.len(),
        claims::list(&losers)
    );
    report.warn("photos-of-other-views", losers.len(), what);
    let lost: BTreeSet<usize> = losers.iter().map(|loser| views[loser.index]).collect();
    let mut index = 0;
    source.views.retain(|view| {
        let is_lost = lost.contains(&index);
        if is_lost {
            let asked = view.photo.as_ref().map_or(&view.name, |photo| &photo.asked);
            let unused = UnusedView { name: asked.clone(), why: Why::NoPhoto, split: view.split };
            source.unused.push(unused);
        }
        index += 1;
        !is_lost
    });
}

/// Gives every view its photo; views without one are left out and counted.
pub(super) fn find_photos(
    capture: &CaptureFolder,
    source: &mut Source,
    folder: &PhotoFolder,
    report: &mut Report,
) -> Result<()> {
    for view in &mut source.views {
        if view.photo.is_none() {
            view.photo = folder.find(&view.name)?;
        }
        if view.photo.is_none() {
            let missing = UnusedView { name: view.name.clone(), why: Why::NoPhoto, split: view.split };
            source.unused.push(missing);
        }
    }
    source.views.retain(|v| v.photo.is_some());
    settle(source, report);
    let unused = source.names_unused(Why::NoPhoto);
    let total = source.views.len() + unused.len();
    // Stored paths may begin above the folder of the photos, and readers may have looked into the folders inside.
    let is_deeper = |view: &SourceView| view.photo_path().parent() != Some(&*capture.root);
    let is_deep = *folder.path() == *capture.root && source.views.iter().any(is_deeper);
    let folders = [folder, &PhotoFolder { is_deep, ..capture.photos("") }];
    let several =
        |name: &str| folders.map(|f| f.several(name)).into_iter().find(|fitting| !fitting.is_empty());
    let (unclear, missing): (Vec<&str>, Vec<&str>) =
        unused.iter().copied().partition(|name| several(name).is_some());
    let example = unclear.first().and_then(|name| Some((*name, several(name)?)));
    let example = example.map_or(String::new(), |(name, fitting)| {
        let fitting: Vec<PathBuf> =
            fitting.iter().map(|path| path.strip_prefix(&capture.root).unwrap_or(path).to_owned()).collect();
        format!("{} may be {}", quoted(name), first_paths(&fitting))
    });
    let names = first_names(missing.iter().copied());
    if source.views.len() < 2 {
        let lacking = match (missing.len(), unclear.len()) {
            (0, 0) => return Err(invalid!(folder.path(), "{total} view with a pose, expected at least two")),
            (count, 0) => format!("photos of {count} of {total} views are missing ({names})"),
            (0, count) => format!("several photos fit each of {count} of {total} views ({example})"),
            (count, unclear) => format!(
                "photos of {count} of {total} views are missing ({names}), and several fit each of {unclear} ({example})"
            ),
        };
        return Err(invalid!(
            folder.path(),
            "{lacking}, at least two are needed; name their folder with --images{}",
            photos_apart::hint(capture, &unused)
        ));
    }
    let are_left_out = |count: usize| if count == 1 { "is left out" } else { "are left out" };
    if !missing.is_empty() {
        let what = format!(
            "{} of {total} views {} no photo in {} and {}: {names}",
            missing.len(),
            if missing.len() == 1 { "has" } else { "have" },
            text::path(folder.path()),
            are_left_out(missing.len())
        );
        report.warn("views-without-photo", missing.len(), what);
    }
    if !unclear.is_empty() {
        let what = format!(
            "{} of {total} views {}, since several photos fit each: {example}; name the folder of the right ones with \
             --images, or move the others away",
            unclear.len(),
            are_left_out(unclear.len())
        );
        report.warn("views-of-several-photos", unclear.len(), what);
    }
    Ok(())
}

/// Gives the views their masks: those of the folder of masks, if there is one, and those that the poses name. Returns
/// the folder.
pub(super) fn find_masks(
    folder: &CaptureFolder,
    source: &mut Source,
    photos: &PhotoFolder,
    options: &LoadOptions,
    report: &mut Report,
) -> Result<Option<PhotoFolder>> {
    let masks = match &options.masks {
        Some(masks) => Some(folder.given(masks, "capture.masks")?),
        None if folder.root.join("masks").is_dir() => Some(folder.photos("masks")),
        None => None,
    };
    let mut named = None;
    for view in &mut source.views {
        if view.mask.is_some() {
            named.clone_from(&view.mask);
        }
        // A mask that is named and not there is missing like one that is not in the folder.
        view.mask = view.mask.take().filter(|mask| is_there(mask));
    }
    if let Some(masks) = &masks {
        // Names may lead out of the folder and back.
        let own: HashSet<PathBuf> = source.views.iter().map(|view| normal(view.photo_path())).collect();
        let is_photo = |path: &Path| own.contains(&normal(path));
        let found: Vec<Option<Match>> =
            source.views.iter().map(|view| masks.find_mask(&view.name, &is_photo)).collect::<Result<_>>()?;
        let (views, claims): (Vec<usize>, Vec<&Match>) =
            found.iter().enumerate().filter_map(|(v, mask)| Some((v, mask.as_ref()?))).unzip();
        let lost: BTreeSet<usize> = claims::losers(&claims).iter().map(|loser| views[loser.index]).collect();
        for (v, mask) in found.into_iter().enumerate().filter(|(v, _)| !lost.contains(v)) {
            let view = &mut source.views[v];
            view.mask = mask.map(|mask| mask.path).or(view.mask.take());
        }
    }
    let without: Vec<&str> =
        source.views.iter().filter(|v| v.mask.is_none()).map(|v| v.name.as_str()).collect();
    let place = match (&masks, &named) {
        (Some(masks), _) => text::path(masks.path()),
        (None, Some(named)) => format!("the files that the poses name, such as {}", text::path(named)),
        (None, None) => {
            masks_apart::warn(folder, photos, &source.views, report);
            return Ok(None);
        }
    };
    if !without.is_empty() {
        let what = format!(
            "{} of {} views have no mask in {place}, so all their pixels count: {}",
            without.len(),
            source.views.len(),
            first_names(without.iter().copied())
        );
        report.warn("views-without-mask", without.len(), what);
    }
    Ok(masks)
}

/// A capture whose files lie elsewhere cannot be moved or shared, and may be a mistake. Folders that the
/// user named are no surprise.
pub(super) fn warn_of_files_outside(
    root: &Path,
    source: &Source,
    named: &[Option<PhotoFolder>],
    report: &mut Report,
) {
    let known = |path: &Path| {
        is_inside(root, path) || named.iter().flatten().any(|folder| is_inside(folder.path(), path))
    };
    let files = source.views.iter().flat_map(|v| [v.photo.as_deref(), v.mask.as_deref()]);
    let files = files.chain([source.points_file.as_deref()]).flatten();
    let outside: Vec<PathBuf> = files.filter(|p| !known(p)).map(Path::to_owned).collect();
    if !outside.is_empty() {
        let what = format!(
            "{} files lie outside the capture's folder {}: {}; copy them into it before you move or share it",
            outside.len(),
            text::path(root),
            first_paths(&outside)
        );
        report.warn("files-outside-the-capture", outside.len(), what);
    }
}
