//! The contents of a COLMAP sparse model as stored, whatever the encoding, and COLMAP's camera models.

use crate::Result;
use crate::text::quoted;
use std::path::Path;

/// A camera, its parameters in COLMAP's order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColmapCamera {
    pub id: u32,
    pub model: ColmapModel,
    pub width: u64,
    pub height: u64,
    pub params: Vec<f64>,
}

/// A registered image and its pose.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColmapImage {
    pub id: u32,
    /// wxyz, camera_from_world.
    pub quaternion: [f64; 4],
    pub translation: [f64; 3],
    pub camera_id: u32,
    pub name: String,
    /// Ids of triangulated points, one per keypoint that has one.
    pub point_ids: Vec<u64>,
}

/// A point as stored, without its track, which the images' keypoints repeat.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColmapPoint {
    pub id: u64,
    pub position: [f64; 3],
    pub rgb: [u8; 3],
    pub error_px: f64,
}

/// A whole sparse model.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColmapSparse {
    pub cameras: Vec<ColmapCamera>,
    pub images: Vec<ColmapImage>,
    pub points: Vec<ColmapPoint>,
}

/// A camera model of COLMAP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ColmapModel {
    pub number: i32,
    pub name: &'static str,
    pub num_params: usize,
    supported: bool,
}

const fn model(number: i32, name: &'static str, num_params: usize, supported: bool) -> ColmapModel {
    ColmapModel { number, name, num_params, supported }
}

/// Numbers, names and parameter counts: COLMAP `src/colmap/sensor/models.h`.
const MODELS: [ColmapModel; 18] = [
    model(0, "SIMPLE_PINHOLE", 3, true),
    model(1, "PINHOLE", 4, true),
    model(2, "SIMPLE_RADIAL", 4, true),
    model(3, "RADIAL", 5, true),
    model(4, "OPENCV", 8, true),
    model(5, "OPENCV_FISHEYE", 8, true),
    model(6, "FULL_OPENCV", 12, true),
    model(7, "FOV", 5, true),
    model(8, "SIMPLE_RADIAL_FISHEYE", 4, true),
    model(9, "RADIAL_FISHEYE", 5, true),
    model(10, "THIN_PRISM_FISHEYE", 12, true),
    model(11, "RAD_TAN_THIN_PRISM_FISHEYE", 16, true),
    model(12, "SIMPLE_DIVISION", 4, true),
    model(13, "DIVISION", 5, true),
    model(14, "SIMPLE_FISHEYE", 3, true),
    model(15, "FISHEYE", 4, true),
    model(16, "EUCM", 6, true),
    // Whole panoramas, which no pinhole image shows.
    model(17, "EQUIRECTANGULAR", 2, false),
];

fn supported_models() -> String {
    let names: Vec<&str> = MODELS.iter().filter(|m| m.supported).map(|m| m.name).collect();
    names.join(", ")
}

/// What to do about a model that is known but not supported, or about a model that is not known.
fn remedy(found: Option<ColmapModel>) -> &'static str {
    match found {
        Some(_) => "cut the panoramas into perspective views and run COLMAP on these",
        None => "run \"colmap image_undistorter\" and use its output",
    }
}

impl ColmapModel {
    /// The model of a number, as binary files name it.
    pub fn by_number(number: i32, path: &Path, camera_id: u32) -> Result<Self> {
        Self::find(path, camera_id, &format!("number {number}"), |m| m.number == number)
    }

    /// The model of a name, as text files have it.
    pub fn by_name(name: &str, path: &Path, camera_id: u32) -> Result<Self> {
        Self::find(path, camera_id, &quoted(name), |m| m.name == name)
    }

    fn find(path: &Path, camera_id: u32, shown: &str, is: impl Fn(&Self) -> bool) -> Result<Self> {
        match MODELS.into_iter().find(|m| is(m)) {
            Some(m) if m.supported => Ok(m),
            found => {
                let known = found.map_or(String::new(), |m| format!(" ({})", m.name));
                Err(unsupported!(
                    path,
                    "camera {camera_id} has the camera model {shown}{known}; supported: {}; {}",
                    supported_models(),
                    remedy(found)
                ))
            }
        }
    }
}
