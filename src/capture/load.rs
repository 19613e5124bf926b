//! The steps from a folder to a [`Capture`]: find the poses, read them, find the photos and masks,
//! split, and move everything into the local frame.

use super::folder::CaptureFolder;
use super::loaded::Capture;
use super::options::{CaptureFormat, LoadOptions};
use super::pose_format::Found;
use super::source::{Source, SourceView};
use super::store::ImageStore;
use super::zipped::Unpacked;
use super::{
    advice, elsewhere, far, formats, frame, health, left_out, overlap, photo_files, plausible, recipes,
    repeated, split, undistortion, unposed, zipped,
};
use crate::camera::up;
use crate::views::Split;
use crate::{Error, Report, Result, input_file};
use litetex_exporters::unknown_kind;
use std::path::Path;

/// What to do with an archive of photos without poses: commands need a folder.
const UNPACK: &str =
    "its photos have no poses yet; unpack it, and \"litetex capture FOLDER -o CAPTURE\" finds them";

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

    /// Whether a file is one of those that lead to the capture around them, as `sparse/0/images.bin` does.
    pub fn is_pose_file(path: &Path) -> bool {
        find_around(path, &|_| true, &mut Report::default()).is_some()
    }
}

fn load(path: &Path, options: &LoadOptions) -> Result<Capture> {
    check(options)?;
    input_file::check_exists(path)?;
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
    let mut report = Report::default();
    let (format, found) = find_poses(path, options, archive.is_some(), &mut report)?;
    let folder = CaptureFolder::new(&found.root, options.images.as_deref(), archive.is_some())?;
    let mut source = (found.read)(&folder)?;
    if source.points.is_empty() && source.broken_points.is_empty() {
        formats::points_files::name(&folder.root, &mut source);
    }
    report.merge(std::mem::take(&mut source.report));
    if source.num_posed() == 0 {
        return Err(Error::invalid(
            &source.path,
            "no registered images; the reconstruction failed: run it again with more overlap",
        ));
    }
    left_out::points(&mut source, &mut report)?;
    repeated::leave_out(&mut source, &mut report)?;
    if !options.keep_far {
        far::leave_out(&mut source, &mut report);
    }
    let capture_from_local = frame::capture_from_local(&source, &mut report);
    let near = frame::near(&source, capture_from_local.scale);
    photo_files::settle(&mut source, &mut report);
    sort_by_name(&mut source);
    let photos = photo_files::photo_folder(&folder, &source)?;
    let has_observations = format.entry().has_observations;
    // Sparse models name photos in the photo folder, other forms anywhere.
    let on_disk = unposed::count(&source, &photos, has_observations);
    on_disk.warn(&mut report);
    let health = has_observations
        .then(|| health::check(&source, capture_from_local.scale, on_disk.present, &mut report));
    photo_files::find_photos(&folder, &mut source, &photos, &mut report)?;
    let masks = photo_files::find_masks(&folder, &mut source, &photos, options, &mut report)?;
    photo_files::warn_of_files_outside(&folder.root, &source, &[Some(photos), masks], &mut report);
    let (splits, split_by) = split::assign(&source, options, &mut report)?;
    if !splits.contains(&Split::Train) {
        return Err(invalid!(
            &source.path,
            "all {} views are held out by {split_by}; hold out fewer with --test-every or --test-list",
            splits.len()
        ));
    }
    let kept = undistortion::kept(&source.views, options.undistort_focal);
    let recipes = recipes::recipes(&source.views, &kept, options, &mut report)?;
    let undistortion = undistortion::check(&source.views, &kept, &mut report);
    plausible::check(&source.views, &recipes, &mut report);
    let views = recipes::views(&source.views, &recipes, &splits, &capture_from_local);
    overlap::check(&views, &source, &capture_from_local, &mut report);
    // The local frame is not turned.
    let up = up::find(views.iter().map(|v| v.camera.camera_from_local.rotation), source.stated_up);
    if let Some(disagreement) = up.disagreement() {
        report.warn("up-not-as-stated", 1, disagreement);
    }
    if let Some(uncertainty) = up.uncertainty() {
        report.warn("up-uncertain", 1, uncertainty);
    }
    Ok(Capture {
        name: name_of(&folder.root),
        format,
        poses: source.path,
        views,
        points: source.points,
        capture_from_local,
        up,
        metric: source.metric,
        near,
        health,
        photos_without_pose: on_disk.without_pose(),
        split_by,
        undistortion,
        report,
        observed: source.views.into_iter().map(|view| view.observed).collect(),
        store: ImageStore::new(recipes, |view| splits[view] == Split::Train, options.image_cache_bytes),
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

/// Levels of folders around a pose file in which its capture may begin: of `sparse/0/cameras.bin` the third.
const AROUND: usize = 3;

/// The capture around the pose file that the user named.
fn find_around(
    file: &Path,
    wanted: &dyn Fn(&CaptureFormat) -> bool,
    report: &mut Report,
) -> Option<(CaptureFormat, Found)> {
    let file = Some(file).filter(|file| file.is_file())?.canonicalize().ok()?;
    let folders: Vec<&Path> = file.ancestors().skip(1).take(AROUND).collect();
    for folder in folders.into_iter().rev() {
        for format in CaptureFormat::all().filter(wanted) {
            let mut said = Report::default();
            if let Some(found) = (format.entry().find)(folder, &mut said)
                && found.files.iter().any(|pose_file| pose_file.canonicalize().is_ok_and(|p| p == file))
            {
                report.merge(said);
                return Some((format, found));
            }
        }
    }
    None
}

/// The poses in the first format that is there, or in the one requested.
fn find_poses(
    path: &Path,
    options: &LoadOptions,
    is_archive: bool,
    report: &mut Report,
) -> Result<(CaptureFormat, Found)> {
    let wanted = |format: &CaptureFormat| options.format.is_none_or(|f| f == *format);
    if let Some(found) = find_around(path, &wanted, report) {
        return Ok(found);
    }
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
    let unread = || formats::unread::problem(path).filter(|_| options.format.is_none());
    if elsewhere.is_none()
        && let Some(problem) = unread()
    {
        return Err(problem);
    }
    let is_elsewhere = elsewhere.is_some();
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
        match advice {
            Some(advice) if is_elsewhere => invalid!(path, "no poses found here: {advice}"),
            Some(advice) => {
                invalid!(path, "no poses found: {advice}\nPoses are read from: {files}")
            }
            None => invalid!(path, "no poses found; expected {files} here"),
        }
    })
}

/// Sorts the views; a view that occurs on both sides of the split is held out.
fn sort_by_name(source: &mut Source) {
    let is_test = |v: &SourceView| v.split == Some(Split::Test);
    source.views.sort_by(|a, b| a.name.cmp(&b.name).then(is_test(b).cmp(&is_test(a))));
    source.views.dedup_by(|later, first| later.name == first.name);
}
