//! The recordings of Record3D: `metadata.json` beside `rgb/N.jpg` (EXR + RGBD), or `metadata` beside `rgbd/N.jpg` (an
//! unpacked .r3d).
//!
//! As the author of the app states (issues 27 and 88 of marek-simonik/record3d) and nerfstudio reads it: each of `poses` is
//! `capture_from_camera`, a quaternion x, y, z, w and a position in metres, of a camera with x to the right, y up and z
//! backward. The first camera sets the axes, so no direction is stated as up. `perFrameIntrinsicCoeffs` are fx, fy, cx, cy
//! of each photo, `K` is the matrix of all by columns, in pixels of the size w, h; lenses have no distortion.

use super::axes::from_opengl;
use super::left_out::LeftOut;
use super::lookup::photo_folder;
use crate::camera::{Pinhole, RigidTransform};
use crate::capture::folder::CaptureFolder;
use crate::capture::lens::{Distortion, Lens};
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView};
use crate::{Report, Result, input_file};
use glam::{DMat3, DQuat, DVec3};
use serde::Deserialize;
use std::path::Path;

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "record3d",
    help: "recordings of Record3D",
    files: "Record3D's metadata.json with its folder rgb or rgbd",
    has_observations: false,
    find,
};

/// Folders of the photos.
const PHOTOS: [&str; 2] = ["rgb", "rgbd"];

/// Two hours at 60 frames a second take less.
const FILE_BYTES_MAX: u64 = 256 << 20;

#[derive(Deserialize)]
struct Metadata {
    w: u32,
    h: u32,
    #[serde(rename = "K")]
    matrix: Option<Vec<f64>>,
    #[serde(rename = "perFrameIntrinsicCoeffs", default)]
    of_frames: Vec<Vec<f64>>,
    poses: Vec<Vec<f64>>,
}

fn find(path: &Path, _: &mut Report) -> Option<Found> {
    let has_photos = PHOTOS.iter().any(|name| path.join(name).is_dir());
    let file = ["metadata.json", "metadata"].map(|name| path.join(name)).into_iter().find(|p| p.is_file())?;
    let is_ours =
        || input_file::read_text(&file, FILE_BYTES_MAX).is_ok_and(|text| text.contains("\"poses\""));
    let found = has_photos && is_ours();
    found.then(|| Found { root: path.to_owned(), read: Box::new(move |folder| read(&file, folder)) })
}

fn read(path: &Path, folder: &CaptureFolder) -> Result<Source> {
    let metadata: Metadata = serde_json::from_str(&input_file::read_text(path, FILE_BYTES_MAX)?)
        .map_err(|e| invalid!(path, "{e}; expected the metadata of Record3D"))?;
    let photos = photo_folder(folder, &PHOTOS);
    let mut source = Source::at(path);
    let mut left_out = LeftOut::default();
    for (index, pose) in metadata.poses.iter().enumerate() {
        let Some(photo) = photos.find(&index.to_string())? else {
            source.without_photo.push(index.to_string());
            continue;
        };
        match metadata.lens(index).and_then(|lens| Ok((lens, camera_from_capture(pose)?))) {
            Ok((lens, camera_from_capture)) => source.views.push(SourceView {
                name: photo.file_name().unwrap_or_default().to_string_lossy().into_owned(),
                photo: Some(photo),
                mask: None,
                lens,
                camera_from_capture,
                split: None,
                observed: Vec::new(),
            }),
            Err(what) => left_out.broken(index.to_string(), what),
        }
    }
    left_out.report(path, source.views.len() + source.without_photo.len(), &mut source.report)?;
    Ok(source)
}

fn camera_from_capture(pose: &[f64]) -> Result<RigidTransform, String> {
    let [x, y, z, w, position @ ..] = pose else {
        return Err(format!("its pose has {} numbers, expected 7", pose.len()));
    };
    let position: [f64; 3] =
        position.try_into().map_err(|_| format!("its pose has {} numbers, expected 7", pose.len()))?;
    let turn = DQuat::from_xyzw(*x, *y, *z, *w);
    if !(turn.length().is_normal() && turn.is_finite()) {
        return Err(format!("its quaternion is {x}, {y}, {z}, {w}"));
    }
    from_opengl(DMat3::from_quat(turn.normalize()), DVec3::from(position))
}

impl Metadata {
    fn lens(&self, index: usize) -> Result<Lens, String> {
        let own = self.of_frames.get(index).map(Vec::as_slice);
        let (fx_px, fy_px, cx_px, cy_px) = match (own, self.matrix.as_deref()) {
            (Some([fx, fy, cx, cy, ..]), _) => (*fx, *fy, *cx, *cy),
            (_, Some([fx, _, _, _, fy, _, cx, cy, _])) => (*fx, *fy, *cx, *cy),
            _ => return Err("neither perFrameIntrinsicCoeffs nor K has its intrinsics".to_owned()),
        };
        let pinhole = Pinhole { width_px: self.w, height_px: self.h, fx_px, fy_px, cx_px, cy_px };
        let lens = Lens { pinhole, distortion: Distortion::None };
        match lens.problem() {
            Some(what) => Err(what),
            None => Ok(lens),
        }
    }
}
