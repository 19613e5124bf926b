//! The steps from a folder to a [`Capture`]: find the poses, read them, find the photos and masks,
//! split, and move everything into the local frame.

use super::decode::Recipe;
use super::folder::{CaptureFolder, PhotoFolder, is_inside, is_there};
use super::health::PhotosOnDisk;
use super::loaded::{Capture, View};
use super::options::{CaptureFormat, ExifTurn, LoadOptions};
use super::photos::{bounded, fit, photo_header, swaps_sides, turn_is_open};
use super::pose_format::Found;
use super::source::{Source, SourceView, UnusedView, Why, first_names, first_paths};
use super::store::ImageStore;
use super::zipped::Unpacked;
use super::{
    advice, elsewhere, far, formats, frame, health, left_out, overlap, plausible, split, undistortion, zipped,
};
use crate::camera::{Camera, Similarity, up};
use crate::text::{self, quoted};
use crate::views::Split;
use crate::{Error, Report, Result};
use litetex_exporters::unknown_kind;
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// What to do with an archive of photos without poses: commands need a folder.
const UNPACK: &str =
    "its photos have no poses yet; unpack it, and \"litetex train FOLDER\" says how to find them";

/// The same where its poses lie deep inside.
const UNPACK_AND_NAME: &str =
    "it has poses in folders inside; unpack it, and \"litetex train FOLDER\" says which to name";

impl Capture {
    /// Reads the poses and points of a capture and checks the sizes of its photos without decoding them.
    ///
    /// `path` is the capture's folder, a ZIP archive of it, its sparse model or its `transforms.json`.
    ///
    /// # Errors
    /// [`Error::InvalidInput`], [`Error::Unsupported`] or [`Error::Io`], naming file,
    /// element, what was found, what was expected and what to do.
    pub fn load(path: &Path, options: &LoadOptions) -> Result<Self> {
        load(path, options)
    }
}

fn load(path: &Path, options: &LoadOptions) -> Result<Capture> {
    check(options)?;
    if !zipped::is_archive(path) {
        return load_folder(path, options, None);
    }
    let unpacked = zipped::unpack(path)?;
    load_folder(&unpacked.root(), options, Some(&unpacked)).map_err(|e| unpacked.name_archive(e)).map(
        |mut capture| {
            capture.name = path
                .with_extension("")
                .file_name()
                .map_or(capture.name, |n| n.to_string_lossy().into_owned());
            capture.root = path.to_owned();
            capture.poses = unpacked.in_archive(&capture.poses);
            for warning in &mut capture.report.warnings {
                warning.message = unpacked.in_words(&warning.message);
            }
            capture.unpacked = Some(unpacked);
            capture
        },
    )
}

fn load_folder(path: &Path, options: &LoadOptions, archive: Option<&Unpacked>) -> Result<Capture> {
    if !path.exists() {
        return Err(Error::invalid(path, "no such file or folder; expected the folder of a capture"));
    }
    let mut report = Report::default();
    let (format, found) = find_poses(path, options, archive.is_some(), &mut report)?;
    let folder = CaptureFolder::new(&found.root, options.images.as_deref(), archive.is_some())?;
    let mut source = (found.read)(&folder)?;
    report.merge(std::mem::take(&mut source.report));
    if source.num_posed() == 0 {
        return Err(Error::invalid(
            &source.path,
            "no registered images; the reconstruction failed: run it again with more overlap",
        ));
    }
    left_out::points(&mut source, &mut report)?;
    if !options.keep_far {
        far::leave_out(&mut source, &mut report);
    }
    let capture_from_local = frame::capture_from_local(&source, &mut report);
    let near = frame::near(&source, capture_from_local.scale);
    sort_by_name(&mut source)?;
    let photos = photo_folder(&folder, &source)?;
    let health = match format.entry().has_observations {
        true => {
            let seen = PhotosOnDisk { present: photos.count(), posed: count_posed(&photos, &source)? };
            Some(health::check(&source, capture_from_local.scale, &seen, &mut report))
        }
        false => None,
    };
    find_photos(&mut source, &photos, &mut report)?;
    let masks = find_masks(&folder, &mut source, options, &mut report)?;
    warn_of_files_outside(&folder.root, &source, &[Some(photos), masks], &mut report);
    let (splits, split_by) = split::assign(&source, options, &mut report)?;
    if !splits.contains(&Split::Train) {
        return Err(invalid!(
            &source.path,
            "all {} views are held out by {split_by}; hold out fewer with --test-every or --test-list",
            splits.len()
        ));
    }
    let made: Vec<(Recipe, bool)> =
        source.views.par_iter().map(|view| recipe(view, options)).collect::<Result<_>>()?;
    let open = source.views.iter().zip(&made).filter(|(_, made)| made.1).map(|(view, _)| view.name.as_str());
    warn_of_open_turns(&open.collect::<Vec<_>>(), &mut report);
    let recipes: Vec<Recipe> = made.into_iter().map(|(recipe, _)| recipe).collect();
    let undistortion = undistortion::check(&source.views, &recipes, &mut report);
    plausible::check(&source.views, &recipes, &mut report);
    let views = views(&source.views, &recipes, &splits, &capture_from_local);
    overlap::check(&views, &source, &capture_from_local, &mut report);
    // The local frame is not turned.
    let up = up::find(views.iter().map(|v| v.camera.camera_from_local.rotation), source.stated_up);
    if let Some(disagreement) = up.disagreement() {
        report.warn("up-not-as-stated", 1, disagreement);
    }
    Ok(Capture {
        name: name_of(&folder.root),
        format,
        poses: source.path,
        views,
        points: source.points,
        capture_from_local,
        up,
        near,
        health,
        split_by,
        undistortion,
        report,
        store: ImageStore::new(recipes, options.image_cache_bytes),
        root: folder.root,
        unpacked: None,
    })
}

fn check(options: &LoadOptions) -> Result<()> {
    if options.max_resolution == 0 {
        return Err(usage!("max-resolution is 0; expected the photos' longer side in pixels"));
    }
    if let Some(bad) = options.background.iter().find(|b| !(0.0..=1.0).contains(*b)) {
        return Err(usage!("background holds {bad}; expected numbers from 0 to 1"));
    }
    Ok(())
}

fn name_of(root: &Path) -> String {
    let resolved = root.canonicalize().unwrap_or_else(|_| root.to_owned());
    resolved.file_name().map_or_else(|| "capture".to_owned(), |n| n.to_string_lossy().into_owned())
}

/// The poses in the first format that is there, or in the one requested.
fn find_poses(
    path: &Path,
    options: &LoadOptions,
    is_archive: bool,
    report: &mut Report,
) -> Result<(CaptureFormat, Found)> {
    let wanted = |format: &CaptureFormat| options.format.is_none_or(|f| f == *format);
    for format in CaptureFormat::all().filter(wanted) {
        if let Some(found) = (format.entry().find)(path, report) {
            return Ok((format, found));
        }
    }
    let colmap = "colmap".parse().ok().filter(wanted);
    if let Some(colmap) = colmap
        && let Some(found) = formats::find_colmap_elsewhere(path, report)
    {
        return Ok((colmap, found));
    }
    let files: Vec<&str> = CaptureFormat::all().filter(wanted).map(|f| f.entry().files).collect();
    let files = files.join(", or ");
    let elsewhere = elsewhere::advice(path, &wanted);
    Err(if path.is_file() {
        let expected = format!("a capture: a folder with {files}, a ZIP archive of it, or a transforms.json");
        match elsewhere.filter(|_| advice::for_path(path).is_some()).or_else(|| advice::for_path(path)) {
            Some(advice) => Error::unsupported(path, advice),
            None => unknown_kind(path, &expected).into(),
        }
    } else {
        let advice = match is_archive {
            true => elsewhere
                .map(|_| UNPACK_AND_NAME)
                .or_else(|| advice::for_path(path).map(|_| UNPACK))
                .map(str::to_owned),
            false => elsewhere.or_else(|| advice::for_path(path)),
        };
        let advice = advice.map(|a| format!(": {a}")).unwrap_or_default();
        invalid!(path, "no poses found; expected {files} here{advice}")
    })
}

/// Sorts the views; a view that occurs on both sides of the split is held out.
fn sort_by_name(source: &mut Source) -> Result<()> {
    let is_test = |v: &SourceView| v.split == Some(Split::Test);
    source.views.sort_by(|a, b| a.name.cmp(&b.name).then(is_test(b).cmp(&is_test(a))));
    let mut twice = None;
    source.views.dedup_by(|later, first| {
        let same = later.name == first.name;
        if same && later.split == first.split {
            twice = Some(first.name.clone());
        }
        same
    });
    match twice {
        Some(name) => Err(invalid!(
            &source.path,
            "the photo {} occurs twice; expected one pose for each photo",
            quoted(&name)
        )),
        None => Ok(()),
    }
}

/// The folder of the photos, which must exist unless the pose file names every photo.
fn photo_folder(folder: &CaptureFolder, source: &Source) -> Result<PhotoFolder> {
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
    let missing = source.unused.iter().find(|v| v.why == Why::NoPhoto);
    let example = source.views.first().map(|v| &v.name).or(missing.map(|v| &v.name));
    Err(invalid!(
        images,
        "no folder of photos; expected photos such as {} there: name the folder with --images",
        quoted(example.map_or("0001.jpg", String::as_str))
    ))
}

/// Number of photos that have a pose, whether their views are used or not.
fn count_posed(folder: &PhotoFolder, source: &Source) -> Result<usize> {
    let mut posed = HashSet::new();
    for view in &source.views {
        posed.extend(match &view.photo {
            Some(photo) => Some(photo.clone()),
            None => folder.find(&view.name)?,
        });
    }
    for view in source.unused.iter().filter(|v| v.why != Why::NoPose) {
        posed.extend(folder.find(&view.name)?);
    }
    Ok(posed.len())
}

/// Gives every view its photo; views without one are left out and counted.
fn find_photos(source: &mut Source, folder: &PhotoFolder, report: &mut Report) -> Result<()> {
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
    let missing = source.names_unused(Why::NoPhoto);
    let total = source.views.len() + missing.len();
    let names = first_names(missing.iter().copied());
    if source.views.len() < 2 {
        return Err(Error::invalid(
            folder.path(),
            match missing.is_empty() {
                true => format!("{total} view with a pose, expected at least two"),
                false => format!(
                    "photos of {} of {total} views are missing ({names}), at least two are needed; name their \
                     folder with --images",
                    missing.len()
                ),
            },
        ));
    }
    if !missing.is_empty() {
        let what = format!(
            "{} of {total} views have no photo in {} and are left out: {names}",
            missing.len(),
            text::path(folder.path())
        );
        report.warn("views-without-photo", missing.len(), what);
    }
    Ok(())
}

/// Gives the views their masks: those of the folder of masks, if there is one, and those that the poses name. Returns
/// the folder.
fn find_masks(
    folder: &CaptureFolder,
    source: &mut Source,
    options: &LoadOptions,
    report: &mut Report,
) -> Result<Option<PhotoFolder>> {
    let masks = match &options.masks {
        Some(masks) => Some(folder.given(masks, "--masks")?),
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
        if let Some(masks) = &masks {
            view.mask = masks.find_mask(&view.name)?.or(view.mask.take());
        }
    }
    let without: Vec<&str> =
        source.views.iter().filter(|v| v.mask.is_none()).map(|v| v.name.as_str()).collect();
    let place = match (&masks, &named) {
        (Some(masks), _) => text::path(masks.path()),
        (None, Some(named)) => format!("the files that the poses name, such as {}", text::path(named)),
        (None, None) => return Ok(None),
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
fn warn_of_files_outside(root: &Path, source: &Source, named: &[Option<PhotoFolder>], report: &mut Report) {
    let known = |path: &Path| {
        is_inside(root, path) || named.iter().flatten().any(|folder| is_inside(folder.path(), path))
    };
    let files = source.views.iter().flat_map(|v| [&v.photo, &v.mask]).chain([&source.points_file]).flatten();
    let outside: Vec<&PathBuf> = files.filter(|p| !known(p)).collect();
    if !outside.is_empty() {
        let what = format!(
            "{} files lie outside the capture's folder {}: {}; copy them into it before you move or share it",
            outside.len(),
            text::path(root),
            first_paths(outside.iter().copied())
        );
        report.warn("files-outside-the-capture", outside.len(), what);
    }
}

fn recipe(view: &SourceView, options: &LoadOptions) -> Result<(Recipe, bool)> {
    let photo = view.photo.clone().unwrap_or_default();
    let header = photo_header(&photo)?;
    let (photo_size, turn) = fit(&photo, &view.name, &view.lens, &header, options.exif)?;
    // An unreadable mask is reported when it is decoded.
    let mask_header = view.mask.as_ref().and_then(|mask| photo_header(mask).ok());
    let turns = swaps_sides(turn);
    let recipe = Recipe {
        photo,
        photo_size,
        turn,
        has_alpha: header.has_alpha,
        photo_bytes: header.colours_bytes(turns),
        mask: view.mask.clone(),
        mask_bytes: mask_header.map_or(0, |header| header.mask_bytes(turns)),
        mask_invert: options.mask_invert,
        lens: view.lens,
        focal_scale: undistortion::focal_scale(&view.lens, options.undistort_focal),
        memory_bytes: options.photo_memory_bytes,
        size: bounded(photo_size, options.max_resolution),
        background: options.background,
        keep_alpha: options.keep_alpha,
    };
    let needed_bytes = recipe.working_bytes();
    if needed_bytes > options.photo_memory_bytes {
        return Err(unsupported!(
            &recipe.photo,
            "decoding this photo of {}x{} pixels takes {} of memory, and one photo may take {}; allow more with --set \
             capture.photo-memory-bytes={needed_bytes} (inspect: --photo-memory {}GiB), or use smaller copies with --images",
            photo_size.0,
            photo_size.1,
            text::format_bytes(needed_bytes),
            text::format_bytes(options.photo_memory_bytes),
            needed_bytes.div_ceil(1 << 30)
        ));
    }
    let is_open = options.exif == ExifTurn::Auto && turn_is_open(&view.lens, &header);
    Ok((recipe, is_open))
}

/// Warns of photos whose EXIF data ask for a turn that their sides do not show.
fn warn_of_open_turns(names: &[&str], report: &mut Report) {
    if !names.is_empty() {
        let what = format!(
            "the EXIF data of {} photos ask to turn or mirror them, and their sides do not show whether the poses were \
             computed from turned photos; they are taken as stored: {}; if views fit badly, --set capture.exif=apply turns \
             them (inspect: --exif apply), capture.exif=ignore confirms this",
            names.len(),
            first_names(names.iter().copied())
        );
        report.warn("photos-turned-by-exif", names.len(), what);
    }
}

fn views(
    sources: &[SourceView],
    recipes: &[Recipe],
    splits: &[Split],
    capture_from_local: &Similarity,
) -> Vec<View> {
    sources
        .iter()
        .zip(recipes)
        .zip(splits)
        .map(|((view, recipe), &split)| View {
            name: view.name.clone(),
            split,
            camera: Camera {
                // In two steps: a scaled copy of the photo may have rounded sides.
                pinhole: undistortion::pinhole(recipe)
                    .resized(recipe.photo_size.0, recipe.photo_size.1)
                    .resized(recipe.size.0, recipe.size.1),
                camera_from_local: capture_from_local.rebase_camera(&view.camera_from_capture),
            },
        })
        .collect()
}
