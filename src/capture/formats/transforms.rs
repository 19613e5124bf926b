//! `transforms.json` of nerfstudio and instant-ngp, and `transforms_train.json` / `_test.json` of
//! Blender scenes. Poses are OpenGL camera-to-world (x right, y up, z backward).

use super::json::{self, Number};
use super::listed_split::{Filenames, Flags, Use, uses};
use super::ply;
use crate::camera::{Pinhole, RigidTransform};
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::{Distortion, Lens, Tilt};
use crate::capture::photos::photo_size;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, checked_pose};
use crate::text::{self, quoted};
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
    camera_angle_x: Option<Number>,
    camera_angle_y: Option<Number>,
    fl_x: Option<Number>,
    fl_y: Option<Number>,
    cx: Option<Number>,
    cy: Option<Number>,
    // Some tools write sizes as 1920.0.
    w: Option<Number>,
    h: Option<Number>,
    k1: Option<Number>,
    k2: Option<Number>,
    k3: Option<Number>,
    k4: Option<Number>,
    k5: Option<Number>,
    k6: Option<Number>,
    p1: Option<Number>,
    p2: Option<Number>,
}

#[derive(Debug, Deserialize)]
struct Frame {
    file_path: String,
    mask_path: Option<String>,
    transform_matrix: Option<Vec<Vec<Number>>>,
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
    source.stated_up = files.first().is_some_and(|f| is_of_blender(&f.0)).then_some(DVec3::Z);
    for (path, split) in files {
        read_one(path, *split, folder, &mut source)?;
    }
    let is_brown = |v: &&SourceView| matches!(v.lens.distortion, Distortion::Brown { .. });
    let num_brown = source.views.iter().filter(is_brown).count();
    if num_brown > 0 {
        let what = format!(
            "{}: k4 of {num_brown} of {} views is taken for the r^8 term of Brown's lens, which converters from Metashape \
             and RealityCapture write; with the camera_model FULL_OPENCV it is OpenCV's denominator",
            text::path(&source.path),
            source.views.len()
        );
        source.report.warn("brown-k4", num_brown, what);
    }
    if let [_, (held_out, _)] = files {
        source.split_by = Some(quoted(&held_out.file_name().unwrap_or_default().to_string_lossy()));
    }
    strip_common_folder(&mut source.views);
    Ok(source)
}

fn read_one(path: &Path, split: Option<Split>, folder: &CaptureFolder, source: &mut Source) -> Result<()> {
    let mut file: File = json::read(path, "the JSON of nerfstudio, instant-ngp or Blender")?;
    let mut left_out = LeftOut::default();
    let first_test = file.frames.len();
    file.frames.extend(file.test_frames.take().unwrap_or_default());
    let frames: Vec<_> = file.frames.iter().map(|f| (f.file_path.as_str(), &f.flags)).collect();
    let filenames = std::mem::take(&mut file.filenames);
    // Blender's files say by their names what they hold.
    let beside = split.is_none().then_some(folder);
    let uses = uses(path, &frames, first_test, filenames, beside, &mut source.report)?;
    source.split_by = source.split_by.take().or(uses.split_by);
    // `--images images_4` replaces the leading folders of the stored paths.
    let photos = folder.images.clone().unwrap_or_else(|| folder.photos(""));
    for (index, frame) in file.frames.iter().enumerate() {
        let Use::View(listed) = uses.frames[index] else { continue };
        let element = format!("frames[{index}] ({})", quoted(&frame.file_path));
        let camera_from_capture = match pose(frame.transform_matrix.as_deref()) {
            Ok(pose) => pose,
            Err(problem) => {
                left_out.push(element, format!("transform_matrix: {problem}"));
                continue;
            }
        };
        let Some(photo) = photos.find(&plain(&frame.file_path))? else {
            source.without_photo.push(frame.file_path.clone());
            continue;
        };
        let intrinsics = frame.intrinsics.or(&file.intrinsics);
        let lens = match intrinsics.lens(path, &element, &photo)? {
            Ok(lens) => lens,
            Err(problem) => {
                left_out.push(element, problem);
                continue;
            }
        };
        let mask = frame.mask_path.as_ref().map(|mask| find_mask(folder, mask, &photo)).transpose()?;
        source.views.push(SourceView {
            name: name(&folder.root, &frame.file_path, &photo),
            photo: Some(photo),
            mask,
            lens,
            camera_from_capture,
            split: split.or(listed),
            observed: Vec::new(),
        });
    }
    left_out.finish(path, "views", file.frames.len(), &mut source.report)?;
    if let Some(ply) = &file.ply_file_path {
        let ply = folder.file(ply)?;
        source.points.extend(ply::read_points(&ply)?);
        source.points_file = Some(ply);
    }
    Ok(())
}

/// Whether the frame is Blender's, in which z is up. `transforms.json` of other programs defines none.
fn is_of_blender(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == "transforms_train.json")
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

/// The mask at a stored path, or where it should be. The photo itself, of the same stem, is none.
fn find_mask(folder: &CaptureFolder, stored: &str, photo: &Path) -> Result<PathBuf> {
    match folder.photos("").find_whole(&plain(stored))? {
        Some(found) if found.path != photo => Ok(found.path),
        _ => folder.file(stored),
    }
}

/// camera_from_capture in OpenCV axes from an OpenGL camera-to-world matrix.
fn pose(rows: Option<&[Vec<Number>]>) -> Result<RigidTransform, String> {
    let rows = rows.ok_or("missing")?;
    if !matches!(rows.len(), 3 | 4) || rows.iter().any(|r| r.len() != 4) {
        let found: Vec<usize> = rows.iter().map(Vec::len).collect();
        return Err(format!("rows of {found:?} numbers found, expected 4 (or 3) rows of 4"));
    }
    let column = |j: usize| DVec3::new(rows[0][j].0, rows[1][j].0, rows[2][j].0);
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

    /// The lens of a photo, or what is wrong with its numbers.
    fn lens(&self, path: &Path, element: &str, photo: &Path) -> Result<Result<Lens, String>> {
        let (width_px, height_px) = match (self.w, self.h) {
            (Some(Number(w)), Some(Number(h))) => {
                let whole = |v: f64| ((1.0..=1e6).contains(&v) && v.fract() == 0.0).then_some(v as u32);
                match (whole(w), whole(h)) {
                    (Some(w), Some(h)) => (w, h),
                    _ => return Ok(Err(format!("the size (w, h) is {:?}", (w, h)))),
                }
            }
            _ => photo_size(photo)?,
        };
        let (w, h) = (f64::from(width_px), f64::from(height_px));
        let from_angle = |side: f64, angle: f64| 0.5 * side / (0.5 * angle).tan();
        let number = |value: Option<Number>| value.map(|Number(value)| value);
        let fx_px = number(self.fl_x).or_else(|| self.camera_angle_x.map(|Number(a)| from_angle(w, a)));
        let Some(fx_px) = fx_px else {
            return Ok(Err("no fl_x and no camera_angle_x, neither here nor for the file".to_owned()));
        };
        let fy_px = number(self.fl_y).or_else(|| self.camera_angle_y.map(|Number(a)| from_angle(h, a)));
        let lens = Lens {
            pinhole: Pinhole {
                width_px,
                height_px,
                fx_px,
                fy_px: fy_px.unwrap_or(fx_px),
                cx_px: number(self.cx).unwrap_or(0.5 * w),
                cy_px: number(self.cy).unwrap_or(0.5 * h),
            },
            distortion: self.distortion(path, element)?,
        };
        Ok(lens.checked())
    }

    fn distortion(&self, path: &Path, element: &str) -> Result<Distortion> {
        let k = [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6].map(|v| v.map_or(0.0, |v| v.0));
        let p = [self.p1, self.p2].map(|v| v.map_or(0.0, |v| v.0));
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
        // Of these names only FULL_OPENCV stands for OpenCV's model with eight coefficients; k4 without the two that belong
        // to it there comes from converters of programs that know Brown's model only.
        if self.camera_model.as_deref() != Some("FULL_OPENCV") && k[3] != 0.0 && k[4..] == [0.0; 2] {
            return Ok(Distortion::Brown { k: [k[0], k[1], k[2], k[3]], p, shear: 0.0 });
        }
        let any = k.iter().chain(&p).any(|&v| v != 0.0);
        Ok(if any { Distortion::Radial { k, p } } else { Distortion::None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distortion(json: &str) -> Distortion {
        let intrinsics: Intrinsics = serde_json::from_str(json).unwrap();
        intrinsics.distortion(Path::new("transforms.json"), "frames[0]").unwrap()
    }

    #[test]
    fn k4_is_browns_unless_the_denominator_is_whole_or_the_model_says_so() {
        let brown = Distortion::Brown { k: [0.1, 0.0, 0.0, 0.2], p: [0.0; 2], shear: 0.0 };
        for model in
            ["", r#""camera_model": "OPENCV", "#, r#""camera_model": "OPENCV", "k5": 0, "k6": 0.0, "#]
        {
            assert_eq!(distortion(&format!(r#"{{{model}"k1": 0.1, "k4": 0.2}}"#)), brown, "{model}");
        }
        for (rest, k) in [
            (r#""k4": 0.2, "k5": 0.3"#, [0.1, 0.0, 0.0, 0.2, 0.3, 0.0]),
            (r#""k4": 0.2, "camera_model": "FULL_OPENCV""#, [0.1, 0.0, 0.0, 0.2, 0.0, 0.0]),
            (r#""k4": 0"#, [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ] {
            let taken = distortion(&format!(r#"{{"k1": 0.1, {rest}}}"#));
            assert_eq!(taken, Distortion::Radial { k, p: [0.0; 2] }, "negative control: {rest}");
        }
        let fisheye = distortion(r#"{"k1": 0.1, "k4": 0.2, "camera_model": "OPENCV_FISHEYE"}"#);
        assert!(matches!(fisheye, Distortion::Fisheye { .. }));
    }
}
