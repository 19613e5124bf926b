//! The steps from a folder to a [`Capture`]: find the poses, read them, find the images and masks,
//! split, and move everything into the local frame.

use super::decode::Recipe;
use super::formats::{colmap, reality_capture, transforms};
use super::options::{CaptureFormat, LoadOptions};
use super::photos::{ImageFolder, bounded, fit};
use super::source::{Source, SourceView, first_names};
use super::store::ImageStore;
use super::{Capture, View, frame, health, split, zipped};
use crate::camera::Camera;
use crate::views::Split;
use crate::{Error, Report, Result};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// See [`Capture::load`].
pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Capture> {
    check(options)?;
    if !zipped::is_archive(path) {
        return load_folder(path, options);
    }
    let unpacked = zipped::unpack(path)?;
    let mut capture = load_folder(&unpacked.root(), options)?;
    capture.name =
        path.with_extension("").file_name().map_or(capture.name, |n| n.to_string_lossy().into_owned());
    capture._unpacked = Some(unpacked);
    Ok(capture)
}

fn load_folder(path: &Path, options: &LoadOptions) -> Result<Capture> {
    if !path.exists() {
        return Err(Error::invalid(path, "no such file or folder; expected the folder of a capture"));
    }
    let mut report = Report::default();
    let (root, mut source) = read(path, options, &mut report)?;
    report.merge(std::mem::take(&mut source.report));
    if source.views.is_empty() && source.without_image.is_empty() {
        return Err(Error::invalid(
            &source.path,
            "no registered images; the reconstruction failed: run it again with more overlap",
        ));
    }
    let capture_from_local = frame::capture_from_local(&source, &mut report);
    let near = frame::near(&source, capture_from_local.scale);
    sort_by_name(&mut source)?;
    let folder = image_folder(&root, &source, options)?;
    let health = (source.format == CaptureFormat::Colmap)
        .then(|| health::check(&source, capture_from_local.scale, folder.count(), &mut report));
    find_images(&mut source, &folder, &mut report)?;
    find_masks(&root, &mut source, options, &mut report)?;
    let splits = split::assign(&mut source.views, options)?;
    if !splits.contains(&Split::Train) {
        return Err(Error::invalid(
            &source.path,
            format!(
                "all {} views are held out; lower the share with --test-every or --test-list",
                splits.len()
            ),
        ));
    }
    let recipes: Vec<Recipe> =
        source.views.par_iter().map(|view| recipe(view, options)).collect::<Result<_>>()?;
    let views = source
        .views
        .iter()
        .zip(&recipes)
        .zip(splits)
        .map(|((view, recipe), split)| View {
            name: view.name.clone(),
            split,
            camera: Camera {
                // In two steps: a scaled copy of the image may have rounded sides.
                pinhole: view
                    .lens
                    .pinhole
                    .resized(recipe.image_size.0, recipe.image_size.1)
                    .resized(recipe.size.0, recipe.size.1),
                camera_from_local: capture_from_local.rebase_camera(&view.camera_from_capture),
            },
            image: recipe.image.clone(),
            image_size_px: recipe.image_size,
            mask: recipe.mask.clone(),
        })
        .collect();
    Ok(Capture {
        name: name_of(&root),
        root,
        format: source.format,
        poses: source.path,
        views,
        points: source.points,
        capture_from_local,
        near,
        health,
        report,
        store: ImageStore::new(recipes, options.image_cache_bytes),
        _unpacked: None,
    })
}

fn check(options: &LoadOptions) -> Result<()> {
    if options.max_resolution == 0 {
        return Err(Error::Usage(
            "max-resolution is 0; expected the images' longer side in pixels".to_owned(),
        ));
    }
    if let Some(bad) = options.background.iter().find(|b| !(0.0..=1.0).contains(*b)) {
        return Err(Error::Usage(format!("background holds {bad}; expected numbers from 0 to 1")));
    }
    Ok(())
}

fn name_of(root: &Path) -> String {
    let resolved = root.canonicalize().unwrap_or_else(|_| root.to_owned());
    resolved.file_name().map_or_else(|| "capture".to_owned(), |n| n.to_string_lossy().into_owned())
}

/// Finds and reads the poses; the capture's folder and what it describes.
fn read(path: &Path, options: &LoadOptions, report: &mut Report) -> Result<(PathBuf, Source)> {
    let images = |root: &Path| {
        let folder = options.images.as_ref();
        folder.map(|f| ImageFolder::given(root, f, "--images")).transpose()
    };
    if path.is_file() {
        if path.extension().is_none_or(|e| e != "json") {
            return Err(Error::unsupported(
                path,
                "no capture; supported: a folder with a COLMAP model or transforms.json, a ZIP archive of it, or a transforms.json",
            ));
        }
        let root = path.parent().unwrap_or(Path::new("")).to_owned();
        let source = transforms::read(&root, &[(path.to_owned(), None)], images(&root)?.as_ref())?;
        return Ok((root, source));
    }
    let wants = |format| options.format.is_none_or(|f| f == format);
    if wants(CaptureFormat::Colmap)
        && let Some(model) = colmap::find_model(path, report)
    {
        return Ok((capture_root(path), colmap::read(&model)?));
    }
    let files = transforms::find_files(path);
    if wants(CaptureFormat::Transforms) && !files.is_empty() {
        return Ok((path.to_owned(), transforms::read(path, &files, images(path)?.as_ref())?));
    }
    if wants(CaptureFormat::RealityCapture)
        && let Some(file) = reality_capture::find_file(path)
    {
        let folder = match images(path)? {
            Some(folder) => folder,
            None if path.join("images").is_dir() => ImageFolder::at(&path.join("images")),
            None => ImageFolder::at(path),
        };
        return Ok((path.to_owned(), reality_capture::read(&file, &folder)?));
    }
    let expected = match options.format {
        Some(CaptureFormat::Colmap) => "a COLMAP model (sparse/0/cameras.bin or .txt)",
        Some(CaptureFormat::Transforms) => "transforms.json or transforms_train.json",
        Some(CaptureFormat::RealityCapture) => {
            "RealityCapture's \"Internal/External camera parameters\" (.csv)"
        }
        None => "a COLMAP model (sparse/0/cameras.bin or .txt), transforms.json or RealityCapture's .csv",
    };
    Err(Error::invalid(path, format!("no poses found; expected {expected} here")))
}

/// If the user named the sparse model itself, the capture is the folder around it.
fn capture_root(path: &Path) -> PathBuf {
    let full = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let is_part = |folder: &Path| {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        name == "sparse" || name == "colmap" || (!name.is_empty() && name.bytes().all(|b| b.is_ascii_digit()))
    };
    let mut root = full.as_path();
    while !root.join("images").is_dir() && is_part(root) {
        match root.parent() {
            Some(parent) => root = parent,
            None => break,
        }
    }
    if root.join("images").is_dir() && root != full {
        return root.to_owned();
    }
    path.to_owned()
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
        Some(name) => Err(Error::invalid(
            &source.path,
            format!("the image {name:?} occurs twice; expected one pose an image"),
        )),
        None => Ok(()),
    }
}

/// The folder of the images, which must exist unless the pose file names every image.
fn image_folder(root: &Path, source: &Source, options: &LoadOptions) -> Result<ImageFolder> {
    if let Some(folder) = &options.images {
        return ImageFolder::given(root, folder, "--images");
    }
    let images = root.join("images");
    if images.is_dir() {
        return Ok(ImageFolder::at(&images));
    }
    let beside = ImageFolder::at(root);
    let found = source.views.iter().any(|v| v.image.is_some() || beside.find(&v.name).is_some());
    if found {
        return Ok(beside);
    }
    Err(Error::invalid(
        images,
        format!(
            "no folder of images; expected images such as {:?} there: name the folder with --images",
            source
                .views
                .first()
                .map(|v| &v.name)
                .or(source.without_image.first())
                .map_or("0001.jpg", String::as_str)
        ),
    ))
}

/// Gives every view its image; views without one are left out and counted.
fn find_images(source: &mut Source, folder: &ImageFolder, report: &mut Report) -> Result<()> {
    let mut missing = std::mem::take(&mut source.without_image);
    for view in &mut source.views {
        view.image = view.image.take().or_else(|| folder.find(&view.name));
        if view.image.is_none() {
            missing.push(view.name.clone());
        }
    }
    source.views.retain(|v| v.image.is_some());
    let total = source.views.len() + missing.len();
    let names = first_names(missing.iter().map(String::as_str));
    if source.views.len() < 2 {
        return Err(Error::invalid(
            folder.path(),
            match missing.is_empty() {
                true => format!("{total} view with a pose, expected at least two"),
                false => format!(
                    "images of {} of {total} views are missing ({names}), at least two are needed; name their \
                     folder with --images",
                    missing.len()
                ),
            },
        ));
    }
    if !missing.is_empty() {
        report.warn(
            "frames-without-image",
            missing.len(),
            format!(
                "{} of {total} views have no image in {} and are left out: {names}",
                missing.len(),
                folder.path().display()
            ),
        );
    }
    Ok(())
}

fn find_masks(root: &Path, source: &mut Source, options: &LoadOptions, report: &mut Report) -> Result<()> {
    let folder = match &options.masks {
        Some(folder) => Some(ImageFolder::given(root, folder, "--masks")?),
        None => Some(root.join("masks")).filter(|p| p.is_dir()).map(|p| ImageFolder::at(&p)),
    };
    if let Some(folder) = folder {
        for view in &mut source.views {
            let found = folder.find_mask(&view.name);
            view.mask = found.or(view.mask.take());
        }
        let without: Vec<&str> =
            source.views.iter().filter(|v| v.mask.is_none()).map(|v| v.name.as_str()).collect();
        if !without.is_empty() {
            report.warn(
                "views-without-mask",
                without.len(),
                format!(
                    "{} of {} views have no mask in {} and count everywhere: {}",
                    without.len(),
                    source.views.len(),
                    folder.path().display(),
                    first_names(without)
                ),
            );
        }
    }
    Ok(())
}

fn recipe(view: &SourceView, options: &LoadOptions) -> Result<Recipe> {
    let image = view.image.clone().unwrap_or_default();
    let (image_size, turn) = fit(&image, &view.name, &view.lens)?;
    Ok(Recipe {
        image,
        image_size,
        turn,
        mask: view.mask.clone(),
        mask_invert: options.mask_invert,
        lens: view.lens,
        size: bounded(image_size, options.max_resolution),
        background: options.background,
    })
}
