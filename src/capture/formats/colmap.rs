//! Converts a COLMAP sparse model to a [`Source`]. `colmap_find` finds it, `colmap_bin` and `colmap_txt` read the two
//! encodings.

use super::colmap_lens::lens;
use super::colmap_model::{ColmapImage, ColmapSparse, Parts};
use super::{colmap_bin, colmap_txt, points_beside};
use crate::capture::left_out::LeftOut;
use crate::capture::lens::Lens;
use crate::capture::source::{Source, SourceView, checked_pose, first_names, first_of};
use crate::text::{counted, quoted};
use crate::views::SfmPoint;
use crate::{Report, Result};
use glam::{DMat3, DQuat, DVec3};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// One of the model's files, in either encoding.
pub(super) fn part(folder: &Path, stem: &str) -> Option<PathBuf> {
    ["bin", "txt"].into_iter().map(|ext| folder.join(format!("{stem}.{ext}"))).find(|p| p.is_file())
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
        let what = format!("{}: neither points3D.bin nor points3D.txt here", folder.display());
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
            None => Parts::default(),
        },
    };
    let used = used_cameras(&sparse);
    for camera in sparse.cameras.good.iter().filter(|c| used.contains(&c.id)) {
        camera.check_supported(&cameras_file)?;
    }
    Ok(sparse)
}

/// The ids that images refer to.
fn used_cameras(sparse: &ColmapSparse) -> HashSet<u32> {
    sparse.images.good.iter().map(|i| i.camera_id).collect()
}

/// Reads a sparse model into a [`Source`].
pub(super) fn read(folder: &Path) -> Result<Source> {
    let mut report = Report::default();
    let sparse = read_sparse(folder, &mut report)?;
    let lenses = lenses(folder, &sparse, &mut report);
    warn_of_ids(folder, &sparse.images.good, &mut report);
    let points = &sparse.points.good;
    let point_index: HashMap<u64, u32> =
        points.iter().enumerate().map(|(index, p)| (p.id, index as u32)).collect();
    let (mut lost, mut left_out) = (0, LeftOut::default());
    let mut views = Vec::with_capacity(sparse.images.good.len());
    for image in &sparse.images.good {
        match view(image, &lenses, &point_index, &mut lost) {
            Ok(view) => views.push(view),
            Err(problem) => {
                let element = format!("image {} ({})", image.id, quoted(&image.name));
                left_out.push_view(element, &image.name.replace('\\', "/"), problem);
            }
        }
    }
    let mut source = Source { report: std::mem::take(&mut report), ..Source::at(folder) };
    if part(folder, "points3D").is_none() {
        // As the converters for Gaussian splats write the points of the model.
        points_beside::read(folder, &["points3d"], &mut source);
    }
    for image in &sparse.images.broken {
        let name = image.name.as_deref().unwrap_or_default().replace('\\', "/");
        left_out.push_view(image.element("image"), &name, image.problem());
    }
    left_out.finish_views(folder, sparse.images.count(), &mut source)?;
    for point in &sparse.points.broken {
        source.broken_points.push((point.element("point"), point.problem()));
    }
    if lost > 0 && !points.is_empty() {
        let what =
            format!("{}: {lost} observations refer to points that are not in the model", folder.display());
        source.report.warn("observations-without-point", lost, what);
    }
    let errors = points.iter().map(|p| p.error_px);
    let (sum, count) =
        errors.filter(|e| e.is_finite() && *e >= 0.0).fold((0.0, 0_u32), |(s, n), e| (s + e, n + 1));
    let of_model = points.iter();
    source.points.extend(
        of_model.map(|p| SfmPoint { position_in_capture: DVec3::from_array(p.position), rgb: p.rgb }),
    );
    Ok(Source { views, reprojection_error_px: (count > 0).then(|| sum / f64::from(count)), ..source })
}

/// The lenses by the ids of their cameras, or what is wrong with them.
struct Lenses {
    by_id: HashMap<u32, Result<Lens, String>>,
    /// What is wrong with the first camera without an id.
    nameless: Option<String>,
}

/// The lenses of all cameras; warns of broken ones that no image uses.
fn lenses(folder: &Path, sparse: &ColmapSparse, report: &mut Report) -> Lenses {
    let used = used_cameras(sparse);
    let (mut by_id, mut unused, mut nameless) = (HashMap::new(), LeftOut::default(), None);
    let (mut first_of_id, mut repeated) = (HashMap::new(), Vec::new());
    for camera in &sparse.cameras.good {
        let name = format!("camera {} ({})", camera.id, camera.model_name());
        let lens = lens(camera);
        if let Some(first) = first_of_id.insert(camera.id, camera) {
            if first == camera {
                repeated.push(name);
            } else {
                by_id.insert(
                    camera.id,
                    Err(format!("camera {} occurs twice, with other parameters", camera.id)),
                );
            }
            continue;
        }
        if let Err(problem) = &lens
            && !used.contains(&camera.id)
        {
            unused.push(name.clone(), problem);
        }
        by_id.insert(camera.id, lens.map_err(|problem| format!("{name}: {problem}")));
    }
    if !repeated.is_empty() {
        let what = format!(
            "{}: {} that repeat another word for word: {}",
            folder.display(),
            counted(repeated.len(), "camera line"),
            first_of(repeated.iter().cloned())
        );
        report.warn("cameras-repeated", repeated.len(), what);
    }
    for camera in &sparse.cameras.broken {
        let (element, problem) = (camera.element("camera"), camera.problem());
        let message = format!("{element}: {problem}");
        match camera.id.and_then(|id| u32::try_from(id).ok()) {
            Some(id) if used.contains(&id) => {
                by_id.entry(id).or_insert(Err(message));
            }
            Some(_) => unused.push(element, problem),
            None => {
                unused.push(element, problem);
                nameless.get_or_insert(message);
            }
        }
    }
    if unused.count() > 0 {
        let what = format!(
            "{}: left out {} of {} cameras, which no view uses: {}",
            folder.display(),
            unused.count(),
            sparse.cameras.count(),
            unused.details()
        );
        report.warn("cameras-left-out", unused.count(), what);
    }
    Lenses { by_id, nameless }
}

/// Warns of images with the id of another, which COLMAP never writes. Nothing here depends on their ids.
fn warn_of_ids(folder: &Path, images: &[ColmapImage], report: &mut Report) {
    let mut name_of = HashMap::new();
    let mut again = Vec::new();
    for image in images {
        if *name_of.entry(image.id).or_insert(&image.name) != &image.name {
            again.push(image);
        }
    }
    if !again.is_empty() {
        let what = format!(
            "{}: {} with the id of another; all are used: {}",
            folder.display(),
            counted(again.len(), "image"),
            first_of(again.iter().map(|image| format!("{} ({})", quoted(&image.name), image.id)))
        );
        report.warn("image-ids-repeated", again.len(), what);
    }
}

/// The view of an image, or what is wrong with it.
fn view(
    image: &ColmapImage,
    lenses: &Lenses,
    point_index: &HashMap<u64, u32>,
    lost: &mut usize,
) -> Result<SourceView, String> {
    if image.name.is_empty() {
        return Err("its name is empty".to_owned());
    }
    let lens = match lenses.by_id.get(&image.camera_id) {
        Some(Ok(lens)) => *lens,
        Some(Err(problem)) => return Err(problem.clone()),
        None => {
            let mut known: Vec<u32> = lenses.by_id.keys().copied().collect();
            known.sort_unstable();
            let known: Vec<String> = known.iter().map(u32::to_string).collect();
            let nameless = lenses.nameless.iter().map(|problem| format!("; {problem}"));
            return Err(format!(
                "it refers to camera {}, but the cameras are {}{}",
                image.camera_id,
                first_names(known.iter().map(String::as_str)),
                nameless.collect::<String>()
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
