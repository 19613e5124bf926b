//! `transforms.json` of nerfstudio and instant-ngp, and `transforms_train.json` / `_test.json` of
//! Blender scenes. Poses are OpenGL camera-to-world (x right, y up, z backward).

use super::bytes::read_text;
use super::listed_split::{Filenames, Flags, Use, uses};
use super::ply;
use crate::camera::{Pinhole, RigidTransform};
use crate::capture::folder::CaptureFolder;
use crate::capture::lens::{Distortion, Lens, Tilt};
use crate::capture::photos::photo_size;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, checked_pose};
use crate::text::quoted;
use crate::views::Split;
use crate::{Report, Result};
use glam::{DMat3, DVec3};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Intrinsics, of the whole file or of one frame.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
struct Intrinsics {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    // Some tools write sizes as 1920.0.
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    k5: Option<f64>,
    k6: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct Frame {
    file_path: String,
    mask_path: Option<String>,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    intrinsics: Intrinsics,
    #[serde(flatten)]
    flags: Flags,
}

#[derive(Debug, Deserialize)]
struct File {
    #[serde(flatten)]
    intrinsics: Intrinsics,
    frames: Vec<Frame>,
    /// Held out (ScanNet++).
    #[serde(default)]
    test_frames: Option<Vec<Frame>>,
    ply_file_path: Option<String>,
    #[serde(flatten)]
    filenames: Filenames,
}

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "transforms",
    help: "transforms.json of nerfstudio, instant-ngp and Blender scenes",
    files: "transforms.json or transforms_train.json",
    has_observations: false,
    find,
};

fn find(path: &Path, _: &mut Report) -> Option<Found> {
    let is_json = path.is_file() && path.extension().is_some_and(|e| e == "json");
    let (root, files) = match is_json {
        true => (path.parent().unwrap_or(Path::new("")), vec![(path.to_owned(), None)]),
        false => (path, files_in(path)),
    };
    let has_files = !files.is_empty();
    has_files.then(|| Found { root: root.to_owned(), read: Box::new(move |folder| read(&files, folder)) })
}

/// The files of a capture with the side of the split that they state. Blender's `transforms_val` serves
/// as test set only where there is no other.
fn files_in(root: &Path) -> Vec<(PathBuf, Option<Split>)> {
    let existing = |name: &str| Some(root.join(name)).filter(|p| p.is_file());
    let test = existing("transforms_test.json");
    let train = existing("transforms_train.json").or_else(|| existing("transforms.json"));
    let Some(train) = train else {
        return Vec::new();
    };
    match test.or_else(|| existing("transforms_val.json")) {
        Some(test) => vec![(train, Some(Split::Train)), (test, Some(Split::Test))],
        None => vec![(train, None)],
    }
}

fn read(files: &[(PathBuf, Option<Split>)], folder: &CaptureFolder) -> Result<Source> {
    let mut source = Source::at(files.first().map_or(&folder.root, |f| &f.0));
    for (path, split) in files {
        read_one(path, *split, folder, &mut source)?;
    }
    if let [_, (held_out, _)] = files {
        source.split_by = Some(quoted(&held_out.file_name().unwrap_or_default().to_string_lossy()));
    }
    strip_common_folder(&mut source.views);
    Ok(source)
}

fn read_one(path: &Path, split: Option<Split>, folder: &CaptureFolder, source: &mut Source) -> Result<()> {
    let mut file: File = serde_json::from_str(&read_text(path)?)
        .map_err(|e| invalid!(path, "{e}; expected the JSON of nerfstudio, instant-ngp or Blender"))?;
    let first_test = file.frames.len();
    file.frames.extend(file.test_frames.take().unwrap_or_default());
    let frames: Vec<_> = file.frames.iter().map(|f| (f.file_path.as_str(), &f.flags)).collect();
    let filenames = std::mem::take(&mut file.filenames);
    let uses = uses(path, &frames, first_test, filenames, folder, &mut source.report)?;
    source.split_by = source.split_by.take().or(uses.split_by);
    for (index, frame) in file.frames.iter().enumerate() {
        let Use::View(listed) = uses.frames[index] else { continue };
        let element = format!("frames[{index}] ({})", quoted(&frame.file_path));
        let camera_from_capture =
            pose(&frame.transform_matrix).map_err(|e| invalid!(path, "{element}: transform_matrix: {e}"))?;
        let Some(photo) = find_photo(folder, &frame.file_path)? else {
            source.without_photo.push(frame.file_path.clone());
            continue;
        };
        let intrinsics = frame.intrinsics.or(&file.intrinsics);
        let lens = intrinsics.lens(path, &element, &photo)?;
        source.views.push(SourceView {
            name: name(&folder.root, &frame.file_path, &photo),
            photo: Some(photo),
            mask: frame.mask_path.as_ref().map(|mask| find_mask(folder, mask)).transpose()?,
            lens,
            camera_from_capture,
            split: split.or(listed),
            observed: Vec::new(),
        });
    }
    if let Some(ply) = &file.ply_file_path {
        let ply = folder.file(ply)?;
        source.points.extend(ply::read_points(&ply)?);
        source.points_file = Some(ply);
    }
    Ok(())
}

/// A stored path without `./` and with forward slashes.
pub(super) fn plain(file_path: &str) -> String {
    let path = file_path.replace('\\', "/");
    path.trim_start_matches("./").to_owned()
}

/// Name of a view: the stored path with the extension of the photo that was found.
fn name(root: &Path, file_path: &str, photo: &Path) -> String {
    let stored = plain(file_path);
    let inside = photo.strip_prefix(root).ok().map(|p| plain(&p.to_string_lossy()));
    match inside {
        Some(inside) if inside.starts_with(&stored) => inside,
        _ => stored,
    }
}

/// Makes names relative to the folder that all photos share, as COLMAP's names are.
fn strip_common_folder(views: &mut [SourceView]) {
    while let Some((folder, _)) = views.first().and_then(|v| v.name.split_once('/')) {
        let prefix = format!("{folder}/");
        if !views.iter().all(|v| v.name.starts_with(&prefix)) {
            break;
        }
        for v in views.iter_mut() {
            v.name.drain(..prefix.len());
        }
    }
}

/// The mask at a stored path, or where it should be.
fn find_mask(folder: &CaptureFolder, stored: &str) -> Result<PathBuf> {
    match folder.photos("").find(&plain(stored))? {
        Some(found) => Ok(found),
        None => folder.file(stored),
    }
}

fn find_photo(folder: &CaptureFolder, file_path: &str) -> Result<Option<PathBuf>> {
    let stored = plain(file_path);
    let Some(images) = &folder.images else {
        return folder.photos("").find(&stored);
    };
    // `--images images_4` replaces the leading folders of the stored path.
    let mut rest = stored.as_str();
    loop {
        if let Some(found) = images.find(rest)? {
            return Ok(Some(found));
        }
        match rest.split_once('/') {
            Some((_, inner)) => rest = inner,
            None => return Ok(None),
        }
    }
}

/// camera_from_capture in OpenCV axes from an OpenGL camera-to-world matrix.
fn pose(rows: &[Vec<f64>]) -> Result<RigidTransform, String> {
    if !matches!(rows.len(), 3 | 4) || rows.iter().any(|r| r.len() != 4) {
        let found: Vec<usize> = rows.iter().map(Vec::len).collect();
        return Err(format!("rows of {found:?} numbers found, expected 4 (or 3) rows of 4"));
    }
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    // y and z of the camera's axes change sign between OpenGL and OpenCV.
    let axes = DMat3::from_cols(column(0), -column(1), -column(2));
    Ok(checked_pose(axes, column(3))?.inverse())
}

impl Intrinsics {
    /// These, completed by those of the whole file.
    fn or(&self, all: &Self) -> Self {
        Self {
            camera_model: self.camera_model.clone().or_else(|| all.camera_model.clone()),
            is_fisheye: self.is_fisheye.or(all.is_fisheye),
            camera_angle_x: self.camera_angle_x.or(all.camera_angle_x),
            camera_angle_y: self.camera_angle_y.or(all.camera_angle_y),
            fl_x: self.fl_x.or(all.fl_x),
            fl_y: self.fl_y.or(all.fl_y),
            cx: self.cx.or(all.cx),
            cy: self.cy.or(all.cy),
            w: self.w.or(all.w),
            h: self.h.or(all.h),
            k1: self.k1.or(all.k1),
            k2: self.k2.or(all.k2),
            k3: self.k3.or(all.k3),
            k4: self.k4.or(all.k4),
            k5: self.k5.or(all.k5),
            k6: self.k6.or(all.k6),
            p1: self.p1.or(all.p1),
            p2: self.p2.or(all.p2),
        }
    }

    fn lens(&self, path: &Path, element: &str, photo: &Path) -> Result<Lens> {
        let invalid = |what: String| invalid!(path, "{element}: {what}");
        let (width_px, height_px) = match (self.w, self.h) {
            (Some(w), Some(h)) => {
                let whole = |v: f64| ((1.0..=1e6).contains(&v) && v.fract() == 0.0).then_some(v as u32);
                match (whole(w), whole(h)) {
                    (Some(w), Some(h)) => (w, h),
                    _ => return Err(invalid(format!("the size (w, h) is {:?}", (w, h)))),
                }
            }
            _ => photo_size(photo)?,
        };
        let (w, h) = (f64::from(width_px), f64::from(height_px));
        let from_angle = |side: f64, angle: f64| 0.5 * side / (0.5 * angle).tan();
        let fx_px = self.fl_x.or_else(|| self.camera_angle_x.map(|a| from_angle(w, a)));
        let Some(fx_px) = fx_px else {
            return Err(invalid("no fl_x and no camera_angle_x, neither here nor for the file".to_owned()));
        };
        let fy_px = self.fl_y.or_else(|| self.camera_angle_y.map(|a| from_angle(h, a)));
        let lens = Lens {
            pinhole: Pinhole {
                width_px,
                height_px,
                fx_px,
                fy_px: fy_px.unwrap_or(fx_px),
                cx_px: self.cx.unwrap_or(0.5 * w),
                cy_px: self.cy.unwrap_or(0.5 * h),
            },
            distortion: self.distortion(path, element)?,
        };
        match lens.problem() {
            Some(what) => Err(invalid(what)),
            None => Ok(lens),
        }
    }

    fn distortion(&self, path: &Path, element: &str) -> Result<Distortion> {
        let k = [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6].map(|v| v.unwrap_or(0.0));
        let p = [self.p1, self.p2].map(|v| v.unwrap_or(0.0));
        let fisheye = Distortion::Fisheye { k: [k[0], k[1], k[2], k[3], 0.0, 0.0], tilt: Tilt::None };
        match self.camera_model.as_deref() {
            Some("OPENCV_FISHEYE") => return Ok(fisheye),
            Some("SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" | "FULL_OPENCV")
            | None => {}
            Some(other) => {
                return Err(unsupported!(
                    path,
                    "{element}: camera_model {}; supported: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, \
                     OPENCV, FULL_OPENCV, OPENCV_FISHEYE; undistort the photos with another tool",
                    quoted(other)
                ));
            }
        }
        if self.is_fisheye == Some(true) {
            return Ok(fisheye);
        }
        let any = k.iter().chain(&p).any(|&v| v != 0.0);
        Ok(if any { Distortion::Radial { k, p } } else { Distortion::None })
    }
}
