//! Captures of ScanNet++. The DSLR has a `transforms.json` in `dslr/nerfstudio`, whose photos lie in `dslr/resized_images`
//! and whose masks in `dslr/resized_anon_masks` (as nerfstudio's reader of ScanNet++ looks for them). It is read as any other.
//!
//! The iPhone has `iphone/pose_intrinsic_imu.json` beside the photos that the toolbox of ScanNet++ extracts,
//! `iphone/rgb/frame_000000.jpg`. As the toolbox reads it (`iphone/arkit_pcl.py` of scannetpp/scannetpp): `aligned_pose` is
//! `capture_from_camera`, 4 x 4 by rows, in metres, of a camera with x to the right, y down and z forward; `intrinsic` is
//! 3 x 3 by rows, in pixels of the photos. `pose`, before alignment with the scan, is not used. No direction is stated as
//! up.

use super::axes::{from_opencv, from_rows};
use super::json::{self, Number, Part};
use super::lookup::require_photos;
use super::transforms::{self, Folders};
use super::unused;
use crate::camera::Pinhole;
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::{Distortion, Lens};
use crate::capture::photos::photo_size;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, Why};
use crate::text::quoted;
use crate::{Report, Result, input_file};
use glam::DVec3;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "scannetpp",
    help: "captures of ScanNet++, of the DSLR or the iPhone",
    files: "ScanNet++'s folders dslr or iphone",
    has_observations: false,
    find,
};

const FILE: &str = "pose_intrinsic_imu.json";

/// The folder of the DSLR's poses, which the paths of points are relative to. The lists of the split are in the one above.
const POSES: &str = "nerfstudio";

/// Of the DSLR: poses, the folder of their photos and that of their masks.
const DSLR: [(&str, &str, &str); 2] = [
    ("nerfstudio/transforms.json", "resized_images", "resized_anon_masks"),
    ("nerfstudio/transforms_undistorted.json", "undistorted_images", "undistorted_anon_masks"),
];

/// 30,000 photos, with the measurements of motion, take less.
const FILE_BYTES_MAX: u64 = 128 << 20;

#[derive(Deserialize)]
struct Frame {
    aligned_pose: Option<[[Number; 4]; 4]>,
    intrinsic: [[Number; 3]; 3],
}

fn find(path: &Path, _: &mut Report) -> Option<Found> {
    if let Some(found) = [path.join("dslr"), path.to_owned()].iter().find_map(|dslr| find_dslr(dslr)) {
        return Some(found);
    }
    let root = [path.join("iphone"), path.to_owned()].into_iter().find(|root| root.join(FILE).is_file())?;
    let file = root.join(FILE);
    let files = vec![file.clone()];
    Some(Found { files, ..Found::new(&root, Box::new(move |folder| read(&file, folder))) })
}

fn find_dslr(dslr: &Path) -> Option<Found> {
    let (poses, photos, masks) = DSLR.iter().find(|(_, photos, _)| dslr.join(photos).is_dir())?;
    let file = dslr.join(poses);
    if !file.is_file() {
        return None;
    }
    let files = vec![file.clone()];
    let read = move |folder: &CaptureFolder| {
        let images = folder.images.clone().unwrap_or_else(|| folder.photos(photos));
        let inside = |part: &str| folder.inside(part, images.clone());
        transforms::read_at(&file, &Folders { poses: inside(POSES), masks: inside(masks) })
    };
    Some(Found { files, ..Found::new(dslr, Box::new(read)) })
}

fn read(path: &Path, folder: &CaptureFolder) -> Result<Source> {
    input_file::check(path, FILE_BYTES_MAX)?;
    let frames: BTreeMap<String, Part<Frame>> = json::read(path, "the poses of ScanNet++'s iPhone")?;
    let photos = folder.images.clone().unwrap_or_else(|| folder.photos("rgb"));
    let mut source = Source::at(path);
    source.metric = Some("ScanNet++");
    let mut left_out = LeftOut::default();
    for (name, frame) in frames {
        let element = format!("camera {}", quoted(&name));
        let frame = match frame.0 {
            Ok(frame) => frame,
            Err(what) => {
                left_out.push_view(element, &name, what);
                continue;
            }
        };
        let Some(pose) = frame.aligned_pose else {
            source.leave_out(name, Why::NoPose);
            continue;
        };
        let Some(photo) = photos.find(&name)? else {
            source.leave_out(name, Why::NoPhoto);
            continue;
        };
        let pose = pose.map(|row| row.map(|v| v.0));
        let row = |i: usize| [pose[i][0], pose[i][1], pose[i][2]];
        let axes = from_rows([row(0), row(1), row(2)]);
        let camera_from_capture = from_opencv(axes, DVec3::new(pose[0][3], pose[1][3], pose[2][3]));
        let (width_px, height_px) = photo_size(&photo)?;
        let [[fx_px, _, cx_px], [_, fy_px, cy_px], _] = frame.intrinsic.map(|row| row.map(|v| v.0));
        let pinhole = Pinhole { width_px, height_px, fx_px, fy_px, cx_px, cy_px };
        let lens = Lens { pinhole, distortion: Distortion::None };
        match (camera_from_capture, lens.problem()) {
            (Ok(camera_from_capture), None) => {
                let name = photo.file_name().unwrap_or_default().to_string_lossy().into_owned();
                source.views.push(SourceView::new(name, photo, lens, camera_from_capture));
            }
            (Err(what), _) | (_, Some(what)) => left_out.push_view(element, &name, what),
        }
    }
    let remedy = format!(
        "extract them with the toolbox of ScanNet++ or, in {}, with: ffmpeg -i rgb.mkv -start_number 0 -q:v 1 \
         rgb/frame_%06d.jpg",
        crate::text::path(&folder.root)
    );
    let total = source.num_posed() + left_out.count();
    left_out.finish_views(path, total, &mut source)?;
    require_photos(folder, &source, &photos, &remedy)?;
    unused::report(&mut source);
    Ok(source)
}
