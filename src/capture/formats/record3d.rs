//! The recordings of Record3D: `metadata.json` beside `rgb/N.jpg` (EXR + RGBD), or `metadata` beside `rgbd/N.jpg` (an
//! unpacked .r3d).
//!
//! As the author of the app states (issues 27 and 88 of marek-simonik/record3d) and nerfstudio reads it: each of `poses` is
//! `capture_from_camera`, a quaternion x, y, z, w and a position in metres, of a camera with x to the right, y up and z
//! backward. The first camera sets the axes, so no direction is stated as up. `perFrameIntrinsicCoeffs` are fx, fy, cx, cy
//! of each photo, `K` is the matrix of all by columns, in pixels of the size w, h; lenses have no distortion.

use super::axes::from_opengl;
use super::json::{self, Number, Part};
use super::lookup::{photo_folder, require_photos};
use crate::camera::{Pinhole, RigidTransform};
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::{Distortion, Lens};
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, Why};
use crate::text::quoted;
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

/// An hour at 60 frames a second takes less.
const FILE_BYTES_MAX: u64 = 64 << 20;

#[derive(Deserialize)]
struct Metadata {
    w: u32,
    h: u32,
    #[serde(rename = "K")]
    matrix: Option<Part<[Number; 9]>>,
    #[serde(rename = "perFrameIntrinsicCoeffs", default)]
    of_frames: Vec<Part<[Number; 4]>>,
    poses: Vec<Part<[Number; 7]>>,
}

fn find(path: &Path, _: &mut Report) -> Option<Found> {
    let has_photos = PHOTOS.iter().any(|name| path.join(name).is_dir());
    let file = ["metadata.json", "metadata"].map(|name| path.join(name)).into_iter().find(|p| p.is_file())?;
    let text = input_file::read_text(&file, FILE_BYTES_MAX).ok()?;
    // Without its photos, a file of this name may be of any program.
    let marks: &[&str] = if has_photos { &["\"poses\""] } else { &["\"poses\"", "\"w\"", "\"h\"", "\"K\""] };
    let found = marks.iter().all(|mark| text.contains(mark));
    found.then(|| {
        let files = vec![file.clone()];
        Found { files, ..Found::new(path, Box::new(move |folder| read(&file, folder))) }
    })
}

fn read(path: &Path, folder: &CaptureFolder) -> Result<Source> {
    input_file::check(path, FILE_BYTES_MAX)?;
    let metadata: Metadata = json::read(path, "the metadata of Record3D")?;
    let photos = photo_folder(folder, &PHOTOS);
    let mut source = Source::at(path);
    source.metric = Some("Record3D");
    let mut left_out = LeftOut::default();
    for (index, pose) in metadata.poses.iter().enumerate() {
        let stem = index.to_string();
        let Some(photo) = photos.find(&stem)? else {
            source.leave_out(stem, Why::NoPhoto);
            continue;
        };
        let pose = pose.0.clone().map_err(|e| format!("its pose: {e}"));
        let pose = pose.and_then(|pose| camera_from_capture(pose.map(|v| v.0)));
        match pose.and_then(|pose| Ok((metadata.lens(index)?, pose))) {
            Ok((lens, camera_from_capture)) => {
                let name = photo.file_name().unwrap_or_default().to_string_lossy().into_owned();
                source.views.push(SourceView::new(name, photo, lens, camera_from_capture));
            }
            Err(what) => left_out.push_view(format!("camera {}", quoted(&stem)), &stem, what),
        }
    }
    let total = source.num_posed() + left_out.count();
    left_out.finish_views(path, total, &mut source)?;
    require_photos(folder, &source, &photos, "name their folder with --images")?;
    Ok(source)
}

fn camera_from_capture([x, y, z, w, position @ ..]: [f64; 7]) -> Result<RigidTransform, String> {
    let turn = DQuat::from_xyzw(x, y, z, w);
    if !(turn.length().is_normal() && turn.is_finite()) {
        return Err(format!("its quaternion is {x}, {y}, {z}, {w}"));
    }
    from_opengl(DMat3::from_quat(turn.normalize()), DVec3::from(position))
}

impl Metadata {
    fn lens(&self, index: usize) -> Result<Lens, String> {
        let named = |name: &'static str| move |problem: &String| format!("{name}: {problem}");
        let own = self.of_frames.get(index);
        let own = own.map(|own| own.0.as_ref().copied().map_err(named("perFrameIntrinsicCoeffs")));
        let of_all = || {
            let matrix = self.matrix.as_ref()?.0.as_ref().map_err(named("K"));
            Some(matrix.map(|&[fx, _, _, _, fy, _, cx, cy, _]| [fx, fy, cx, cy]))
        };
        let Some(intrinsics) = own.or_else(of_all) else {
            return Err("neither perFrameIntrinsicCoeffs nor K has its intrinsics".to_owned());
        };
        let [fx_px, fy_px, cx_px, cy_px] = intrinsics?.map(|v| v.0);
        let pinhole = Pinhole { width_px: self.w, height_px: self.h, fx_px, fy_px, cx_px, cy_px };
        let lens = Lens { pinhole, distortion: Distortion::None };
        lens.checked()
    }
}
