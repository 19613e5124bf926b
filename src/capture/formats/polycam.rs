//! The raw data of Polycam: a JSON for each photo of `keyframes`.
//!
//! As the README of PolyCam/polyform specifies: `t_00` to `t_23` is `capture_from_camera` by rows, in metres, of a camera
//! with x to the right, y up and z backward (ARKit); +y is up. fx, fy, cx, cy are in pixels, cx and cy from the corner.
//! `corrected_cameras` belong to the undistorted `corrected_images`, and are better; `cameras` to `images`. Newer versions
//! leave out width and height of corrected cameras.

use super::axes::{from_opengl, from_rows};
use super::lookup::{begins_with_all, files, require_photos};
use crate::camera::Pinhole;
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::{Distortion, Lens};
use crate::capture::photo_folder::Match;
use crate::capture::photos::photo_size;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, Why};
use crate::text::quoted;
use crate::{Report, Result, input_file};
use glam::DVec3;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "polycam",
    help: "raw data of Polycam",
    files: "Polycam's keyframes",
    has_observations: false,
    find,
};

/// Folders of the cameras and of their photos, the better ones first.
const FOLDERS: [(&str, &str); 2] = [("corrected_cameras", "corrected_images"), ("cameras", "images")];

/// A file holds some 40 numbers.
const FILE_BYTES_MAX: u64 = 1 << 20;

#[derive(Deserialize)]
struct Camera {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    // Whole numbers that some versions write as 1024.0.
    width: Option<f64>,
    height: Option<f64>,
    t_00: f64,
    t_01: f64,
    t_02: f64,
    t_03: f64,
    t_10: f64,
    t_11: f64,
    t_12: f64,
    t_13: f64,
    t_20: f64,
    t_21: f64,
    t_22: f64,
    t_23: f64,
}

fn find(path: &Path, _: &mut Report) -> Option<Found> {
    let keyframes = [path.join("keyframes"), path.to_owned()];
    let (keyframes, cameras, photos) = keyframes.iter().find_map(|keyframes| {
        let is_camera = |path: &PathBuf| begins_with_all(path, &["\"t_00\""]);
        let has_cameras = |cameras: &str| files(&keyframes.join(cameras), "json", 0).iter().any(is_camera);
        let complete = FOLDERS
            .iter()
            .find(|(cameras, photos)| keyframes.join(photos).is_dir() && has_cameras(cameras))
            // Their photos are lost, or elsewhere.
            .or_else(|| FOLDERS.iter().find(|(cameras, _)| has_cameras(cameras)));
        complete.map(|(cameras, photos)| (keyframes.clone(), *cameras, *photos))
    })?;
    let cameras = keyframes.join(cameras);
    let files = files(&cameras, "json", 0);
    let read = move |folder: &CaptureFolder| read(&cameras, photos, folder);
    Some(Found { files, ..Found::new(path, Box::new(read)) })
}

fn read(cameras: &Path, photos: &str, folder: &CaptureFolder) -> Result<Source> {
    let keyframes = cameras.parent().and_then(|p| p.strip_prefix(&folder.root).ok()).unwrap_or(Path::new(""));
    let photos =
        folder.images.clone().unwrap_or_else(|| folder.photos(&keyframes.join(photos).to_string_lossy()));
    let mut source = Source::at(cameras);
    source.metric = Some("Polycam");
    source.stated_up = Some(DVec3::Y);
    let mut left_out = LeftOut::default();
    for path in files(cameras, "json", 0) {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let Some(photo) = photos.find(&stem)? else {
            source.leave_out(stem, Why::NoPhoto);
            continue;
        };
        match view(&path, &photo)? {
            Ok(view) => source.views.push(view),
            Err(what) => left_out.push_view(format!("camera {}", quoted(&stem)), &stem, what),
        }
    }
    let total = source.num_posed() + left_out.count();
    left_out.finish_views(cameras, total, &mut source)?;
    require_photos(folder, &source, &photos, "name their folder with --images")?;
    Ok(source)
}

/// The view of a file and its photo, or what is wrong with the file.
fn view(path: &Path, photo: &Match) -> Result<Result<SourceView, String>> {
    let read = input_file::read_text(path, FILE_BYTES_MAX).map_err(|e| e.to_string());
    let camera = read.and_then(|text| {
        serde_json::from_str(&text).map_err(|e| format!("{e}; expected the JSON of a camera of Polycam"))
    });
    let camera: Camera = match camera {
        Ok(camera) => camera,
        Err(problem) => return Ok(Err(problem)),
    };
    let side = |stated: Option<f64>| {
        stated.filter(|v| (1.0..=1e6).contains(v) && v.fract() == 0.0).map(|v| v as u32)
    };
    let (width_px, height_px) = match (side(camera.width), side(camera.height)) {
        (Some(width), Some(height)) => (width, height),
        _ => photo_size(photo)?,
    };
    let Camera { fx: fx_px, fy: fy_px, cx: cx_px, cy: cy_px, .. } = camera;
    let pinhole = Pinhole { width_px, height_px, fx_px, fy_px, cx_px, cy_px };
    let lens = Lens { pinhole, distortion: Distortion::None };
    if let Some(what) = lens.problem() {
        return Ok(Err(what));
    }
    let c = &camera;
    let axes = from_rows([[c.t_00, c.t_01, c.t_02], [c.t_10, c.t_11, c.t_12], [c.t_20, c.t_21, c.t_22]]);
    Ok(from_opengl(axes, DVec3::new(c.t_03, c.t_13, c.t_23)).map(|camera_from_capture| {
        let name = photo.file_name().unwrap_or_default().to_string_lossy().into_owned();
        SourceView::new(name, photo.to_owned(), lens, camera_from_capture)
    }))
}
