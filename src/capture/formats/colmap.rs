//! Finds a COLMAP sparse model and converts it to a [`Source`]. `colmap_bin` and `colmap_txt` read the two encodings.

use super::colmap_model::{ColmapCamera, ColmapImage, ColmapSparse};
use super::{colmap_bin, colmap_txt};
use crate::camera::Pinhole;
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::{Distortion, Lens, Tilt};
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, checked_pose, first_names};
use crate::text::quoted;
use crate::views::SfmPoint;
use crate::{Report, Result};
use glam::{DMat3, DQuat, DVec3};
use std::collections::{HashMap, HashSet};
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
    Some(Found { root: capture_root(path), read: Box::new(move |_| read(&model)) })
}

/// The model that the converter of 3D Gaussian splatting starts from.
const DISTORTED: &str = "distorted/sparse";

/// Where other programs put the sparse model of a capture: COLMAP's dense reconstruction, the converter of 3D Gaussian
/// splatting, and names that people choose. Each is looked at only if there are no poses in the usual places, in this order:
/// the undistorted models first.
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

/// One of the model's files, in either encoding.
fn part(folder: &Path, stem: &str) -> Option<PathBuf> {
    ["bin", "txt"].into_iter().map(|ext| folder.join(format!("{stem}.{ext}"))).find(|p| p.is_file())
}

/// Whether a folder holds a sparse model.
fn is_model(folder: &Path) -> bool {
    part(folder, "cameras").is_some() && part(folder, "images").is_some()
}

/// The sparse model of a capture; warns if there are several.
fn find_model(root: &Path, report: &mut Report) -> Option<PathBuf> {
    for base in ["sparse", "colmap/sparse", ""] {
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
        Some(path) => colmap_txt::read_images(&path).map_or(0, |images| images.len() as u64),
        None => 0,
    }
}

/// Reads the files of a sparse model.
fn read_sparse(folder: &Path, report: &mut Report) -> Result<ColmapSparse> {
    let is_binary = |p: &Path| p.extension().is_some_and(|e| e == "bin");
    let required = |stem: &str| {
        part(folder, stem).ok_or_else(|| invalid!(folder, "neither \"{stem}.bin\" nor \"{stem}.txt\" here"))
    };
    let cameras = required("cameras")?;
    let images = required("images")?;
    let points = part(folder, "points3D");
    if points.is_none() {
        let what = format!("{}: no points3D file: the capture has no points", folder.display());
        report.warn("no-points-file", 1, what);
    }
    let cameras_file = cameras;
    let sparse = ColmapSparse {
        cameras: if is_binary(&cameras_file) {
            colmap_bin::read_cameras(&cameras_file)?
        } else {
            colmap_txt::read_cameras(&cameras_file)?
        },
        images: if is_binary(&images) {
            colmap_bin::read_images(&images)?
        } else {
            colmap_txt::read_images(&images)?
        },
        points: match points {
            Some(p) if is_binary(&p) => colmap_bin::read_points(&p)?,
            Some(p) => colmap_txt::read_points(&p)?,
            None => Vec::new(),
        },
    };
    let used: HashSet<u32> = sparse.images.iter().map(|i| i.camera_id).collect();
    for camera in sparse.cameras.iter().filter(|c| used.contains(&c.id)) {
        camera.model.check_supported(&cameras_file, camera.id)?;
    }
    Ok(sparse)
}

/// Reads a sparse model into a [`Source`].
fn read(folder: &Path) -> Result<Source> {
    let mut report = Report::default();
    let sparse = read_sparse(folder, &mut report)?;
    let lenses = lenses(folder, &sparse, &mut report)?;
    let point_index: HashMap<u64, u32> =
        sparse.points.iter().enumerate().map(|(index, p)| (p.id, index as u32)).collect();
    let (mut lost, mut left_out) = (0, LeftOut::default());
    let mut views = Vec::with_capacity(sparse.images.len());
    for image in &sparse.images {
        match view(image, &lenses, &point_index, &mut lost) {
            Ok(view) => views.push(view),
            Err(problem) => {
                let element = format!("image {} ({})", image.id, quoted(&image.name));
                left_out.push_view(element, &image.name.replace('\\', "/"), problem);
            }
        }
    }
    let mut source = Source::at(folder);
    std::mem::swap(&mut source.report, &mut report);
    left_out.finish_views(folder, sparse.images.len(), &mut source)?;
    std::mem::swap(&mut source.report, &mut report);
    if lost > 0 && !sparse.points.is_empty() {
        let what =
            format!("{}: {lost} observations refer to points that are not in the model", folder.display());
        report.warn("observations-without-point", lost, what);
    }
    let errors = sparse.points.iter().map(|p| p.error_px);
    let (sum, count) =
        errors.filter(|e| e.is_finite() && *e >= 0.0).fold((0.0, 0_u32), |(s, n), e| (s + e, n + 1));
    Ok(Source {
        views,
        points: sparse
            .points
            .iter()
            .map(|p| SfmPoint { position_in_capture: DVec3::from_array(p.position), rgb: p.rgb })
            .collect(),
        reprojection_error_px: (count > 0).then(|| sum / f64::from(count)),
        report,
        ..source
    })
}

/// The lenses by the ids of their cameras, or what is wrong with them; warns of broken cameras that no image uses.
fn lenses(
    folder: &Path,
    sparse: &ColmapSparse,
    report: &mut Report,
) -> Result<HashMap<u32, Result<Lens, String>>> {
    let used: HashSet<u32> = sparse.images.iter().map(|i| i.camera_id).collect();
    let (mut lenses, mut unused) = (HashMap::new(), LeftOut::default());
    for camera in &sparse.cameras {
        let name = format!("camera {} ({})", camera.id, camera.model.name);
        let lens = lens(camera);
        if let Err(problem) = &lens
            && !used.contains(&camera.id)
        {
            unused.push(name.clone(), problem);
        }
        if lenses.insert(camera.id, lens.map_err(|problem| format!("{name}: {problem}"))).is_some() {
            return Err(invalid!(folder, "camera {} occurs twice", camera.id));
        }
    }
    if unused.count() > 0 {
        let what = format!(
            "{}: {} of {} cameras cannot be used and are left out, since no image refers to them: {}",
            folder.display(),
            unused.count(),
            sparse.cameras.len(),
            unused.details()
        );
        report.warn("cameras-left-out", unused.count(), what);
    }
    Ok(lenses)
}

/// Intrinsics and distortion of a camera, or what is wrong with them; parameter orders are COLMAP's.
fn lens(camera: &ColmapCamera) -> Result<Lens, String> {
    let size =
        |value: u64, what: &str| u32::try_from(value).map_err(|_| format!("its {what} is {value} pixels"));
    if !camera.model.is_supported {
        return Err("its model is not supported".to_owned());
    }
    let p = &camera.params;
    let shared_focal = matches!(camera.model.number, 0 | 2 | 3 | 8 | 9 | 12 | 14);
    let (fx_px, fy_px, rest) = if shared_focal { (p[0], p[0], 1) } else { (p[0], p[1], 2) };
    let d = &p[rest + 2..];
    let radial = |k: &[f64], p: [f64; 2]| {
        let mut all = [0.0; 6];
        all[..k.len()].copy_from_slice(k);
        Distortion::Radial { k: all, p }
    };
    let fisheye = |k: &[f64], tilt| {
        let mut all = [0.0; 6];
        all[..k.len()].copy_from_slice(k);
        Distortion::Fisheye { k: all, tilt }
    };
    let distortion = match camera.model.number {
        2 | 3 => radial(d, [0.0; 2]),
        4 => radial(&d[..2], [d[2], d[3]]),
        6 => radial(&[d[0], d[1], d[4], d[5], d[6], d[7]], [d[2], d[3]]),
        5 | 8 | 9 | 14 | 15 => fisheye(d, Tilt::None),
        // Even in omega.
        7 => Distortion::FieldOfView { omega: d[0].abs() },
        10 => {
            let tilt = Tilt::BeforeRadial { p: [d[2], d[3]], s: [d[6], d[7]] };
            fisheye(&[d[0], d[1], d[4], d[5]], tilt)
        }
        11 => {
            let tilt = Tilt::AfterRadial { p: [d[6], d[7]], s: [d[8], d[9], d[10], d[11]] };
            fisheye(&d[..6], tilt)
        }
        12 | 13 => Distortion::Division { k: d[0] },
        16 => Distortion::Unified { alpha: d[0], beta: d[1] },
        _ => Distortion::None,
    };
    let lens = Lens {
        pinhole: Pinhole {
            width_px: size(camera.width, "width")?,
            height_px: size(camera.height, "height")?,
            fx_px,
            fy_px,
            cx_px: p[rest],
            cy_px: p[rest + 1],
        },
        distortion,
    };
    lens.checked()
}

/// The view of an image, or what is wrong with it.
fn view(
    image: &ColmapImage,
    lenses: &HashMap<u32, Result<Lens, String>>,
    point_index: &HashMap<u64, u32>,
    lost: &mut usize,
) -> Result<SourceView, String> {
    if image.name.is_empty() {
        return Err("its name is empty".to_owned());
    }
    let lens = match lenses.get(&image.camera_id) {
        Some(Ok(lens)) => *lens,
        Some(Err(problem)) => return Err(problem.clone()),
        None => {
            let mut known: Vec<u32> = lenses.keys().copied().collect();
            known.sort_unstable();
            let known: Vec<String> = known.iter().map(u32::to_string).collect();
            return Err(format!(
                "it refers to camera {}, but the cameras are {}",
                image.camera_id,
                first_names(known.iter().map(String::as_str))
            ));
        }
    };
    let [w, x, y, z] = image.quaternion;
    let quaternion = DQuat::from_xyzw(x, y, z, w);
    let length = quaternion.length();
    if !(length.is_finite() && length > 1e-9) {
        return Err(format!(
            "its quaternion is {:?}, expected finite numbers and a length of 1",
            image.quaternion
        ));
    }
    let pose = checked_pose(DMat3::from_quat(quaternion / length), DVec3::from_array(image.translation))
        .map_err(|e| format!("its pose: {e}"))?;
    let observed: Vec<u32> = image.point_ids.iter().filter_map(|id| point_index.get(id).copied()).collect();
    *lost += image.point_ids.len() - observed.len();
    Ok(SourceView {
        name: image.name.replace('\\', "/"),
        photo: None,
        mask: None,
        lens,
        camera_from_capture: pose,
        split: None,
        observed,
    })
}
