//! Finds the sparse model of COLMAP: in its usual place, or where other programs put it.

use super::colmap::{part, read};
use super::colmap_txt;
use crate::Report;
use crate::capture::folder::CaptureFolder;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::Source;
use std::path::{Path, PathBuf};

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "colmap",
    help: "COLMAP's sparse model, binary or text",
    files: "a COLMAP model (sparse/0/cameras.bin or .txt)",
    has_observations: true,
    find,
};

fn find(path: &Path, report: &mut Report) -> Option<Found> {
    let model = find_model(path, report)?;
    let files = parts(&model);
    Some(Found { files, ..Found::new(&capture_root(path), Box::new(move |_| read(&model))) })
}

/// The model that the converter of 3D Gaussian splatting starts from.
const DISTORTED: &str = "distorted/sparse";

/// Where other programs put the sparse model of a capture: COLMAP's dense reconstruction, the converter of 3D Gaussian
/// splatting, and names that people choose. Each is looked at only if there are no poses in the usual places, in this order:
/// the undistorted models first. nerfstudio keeps the
/// model that it made `transforms.json` of in `colmap`.
const PLACES: [&str; 8] = [
    "dense/sparse",
    "dense/0/sparse",
    "undistorted/sparse",
    DISTORTED,
    "colmap",
    "colmap/dense/sparse",
    "colmap/dense/0/sparse",
    "model",
];

/// Looks for a sparse model in the places where other programs put it.
pub(crate) fn find_elsewhere(path: &Path, report: &mut Report) -> Option<Found> {
    let (place, model) =
        PLACES.into_iter().find_map(|place| Some((place, find_model(&path.join(place), report)?)))?;
    // Without the slash at the end that joining nothing leaves.
    let model: PathBuf = model.components().collect();
    let what = format!("the poses are those of {}", model.display());
    report.warn("poses-elsewhere", 1, what);
    // Undistorted photos lie beside their model; else the capture's own folder has them.
    let beside = path.join(place.strip_suffix("/sparse").unwrap_or(place));
    let root = if beside.join("images").is_dir() { beside } else { path.to_owned() };
    Some(Found {
        root,
        files: parts(&model),
        // Only the capture's own folder says so: the path to it may hold any name.
        read: Box::new(move |folder| match place == DISTORTED {
            true => read(&model).map(|source| with_originals(source, folder)),
            false => read(&model),
        }),
    })
}

/// The converter of 3D Gaussian splatting keeps the photos of the distorted model in `input`.
fn with_originals(mut source: Source, folder: &CaptureFolder) -> Source {
    if folder.images.is_none() {
        let originals = folder.photos("input");
        for view in &mut source.views {
            // A name that leads out of an archive is refused where all photos are looked for.
            view.photo = originals.find(&view.name).ok().flatten();
        }
    }
    source
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

/// The files of a model, in both encodings.
fn parts(model: &Path) -> Vec<PathBuf> {
    let stems = ["cameras", "images", "points3D"];
    stems.iter().flat_map(|stem| ["bin", "txt"].map(|ext| model.join(format!("{stem}.{ext}")))).collect()
}

/// Whether a folder holds a sparse model.
fn is_model(folder: &Path) -> bool {
    part(folder, "cameras").is_some() && part(folder, "images").is_some()
}

/// The sparse model of a capture; warns if there are several.
fn find_model(root: &Path, report: &mut Report) -> Option<PathBuf> {
    for base in ["sparse", ""] {
        let base = root.join(base);
        let mut models: Vec<PathBuf> = std::fs::read_dir(&base)
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|p| {
                let name = p.file_name().unwrap_or_default().to_string_lossy();
                !name.is_empty() && name.bytes().all(|b| b.is_ascii_digit()) && is_model(p)
            })
            .collect();
        models.sort();
        if is_model(&base) {
            models.insert(0, base);
        }
        if models.len() > 1 {
            let counts: Vec<u64> = models.iter().map(|m| num_images(m)).collect();
            // The first one with the most images.
            let best = (0..models.len()).rev().max_by_key(|&i| counts[i]).unwrap_or(0);
            let what = format!(
                "{} sparse models; using {}, which has the most images ({}); ignoring {}",
                models.len(),
                models[best].display(),
                counts[best],
                (0..models.len())
                    .filter(|&i| i != best)
                    .map(|i| format!("{} ({})", models[i].display(), counts[i]))
                    .collect::<Vec<_>>()
                    .join(", ")
            );
            report.warn("several-sub-models", models.len() - 1, what);
            return Some(models.swap_remove(best));
        }
        if let Some(found) = models.pop() {
            return Some(found);
        }
    }
    None
}

/// Number of images in a model; 0 if it cannot be read, which reading it will report.
fn num_images(folder: &Path) -> u64 {
    match part(folder, "images") {
        Some(path) if path.extension().is_some_and(|e| e == "bin") => {
            let mut head = [0; 8];
            std::fs::File::open(path)
                .and_then(|mut f| std::io::Read::read_exact(&mut f, &mut head))
                .map_or(0, |()| u64::from_le_bytes(head))
        }
        Some(path) => colmap_txt::read_images(&path).map_or(0, |images| images.good.len() as u64),
        None => 0,
    }
}
