//! The contents of a COLMAP sparse model as stored, whatever the encoding, and COLMAP's camera models.

use crate::text::quoted;
use crate::{Error, Result};
use std::path::Path;

/// What a file lists, and those of its parts that cannot be read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Parts<T> {
    pub good: Vec<T>,
    pub broken: Vec<Broken>,
}

impl<T> Default for Parts<T> {
    fn default() -> Self {
        Self { good: Vec::new(), broken: Vec::new() }
    }
}

impl<T> Parts<T> {
    /// Number of all parts.
    pub fn count(&self) -> usize {
        self.good.len() + self.broken.len()
    }
}

/// A part of a file that cannot be read, where those after it can.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Broken {
    /// As far as they can be read.
    pub id: Option<u64>,
    pub name: Option<String>,
    /// Where it is, with the name of the file ("images.txt: line 7").
    pub place: String,
    pub what: String,
}

impl Broken {
    /// For people; `noun` is what it is ("image").
    pub fn element(&self, noun: &str) -> String {
        match (self.id, &self.name) {
            (Some(id), Some(name)) => format!("{noun} {id} ({})", quoted(name)),
            (Some(id), None) => format!("{noun} {id}"),
            (None, _) => self.place.clone(),
        }
    }

    /// What is wrong, and where unless [`Self::element`] says so.
    pub fn problem(&self) -> String {
        match self.id {
            Some(_) => format!("{}: {}", self.place, self.what),
            None => self.what.clone(),
        }
    }
}

/// A camera, its parameters in COLMAP's order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColmapCamera {
    pub id: u32,
    /// Or the name of one that is not known.
    pub model: Result<ColmapModel, String>,
    pub width: u64,
    pub height: u64,
    pub params: Vec<f64>,
}

impl ColmapCamera {
    /// The name of its model.
    pub fn model_name(&self) -> &str {
        self.model.as_ref().map_or_else(String::as_str, |model| model.name)
    }

    /// Whether photos with its model can be undistorted; what no photo uses need not be.
    ///
    /// # Errors
    /// [`Error::Unsupported`] that names the camera and a remedy.
    pub fn check_supported(&self, path: &Path) -> Result<()> {
        match &self.model {
            Ok(model) if model.is_supported => Ok(()),
            Ok(ColmapModel { number, name, .. }) => {
                Err(unsupported(path, self.id, &format!("number {number} ({name})"), CUT))
            }
            Err(name) => Err(unsupported(path, self.id, &quoted(name), UNDISTORT)),
        }
    }
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
    pub cameras: Parts<ColmapCamera>,
    pub images: Parts<ColmapImage>,
    pub points: Parts<ColmapPoint>,
}

/// A camera model of COLMAP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ColmapModel {
    pub number: i32,
    pub name: &'static str,
    pub num_params: usize,
    /// Whether photos with it can be undistorted.
    pub is_supported: bool,
}

const fn model(number: i32, name: &'static str, num_params: usize, is_supported: bool) -> ColmapModel {
    ColmapModel { number, name, num_params, is_supported }
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
    let names: Vec<&str> = MODELS.iter().filter(|m| m.is_supported).map(|m| m.name).collect();
    names.join(", ")
}

/// What to do about a model that is known but not supported.
const CUT: &str = "cut the panoramas into perspective views and run COLMAP on these";

/// What to do about a model that is not known.
const UNDISTORT: &str = "run \"colmap image_undistorter\" and use its output";

fn unsupported(path: &Path, camera_id: u32, shown: &str, remedy: &str) -> Error {
    unsupported!(
        path,
        "camera {camera_id} has the camera model {shown}; supported: {}; {remedy}",
        supported_models()
    )
}

impl ColmapModel {
    /// The model of a number, as binary files name it.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if it is not known, since nobody knows where the next camera begins.
    pub fn by_number(number: i32, path: &Path, camera_id: u32) -> Result<Self> {
        MODELS.into_iter().find(|m| m.number == number).ok_or_else(|| {
            let shown = format!("number {number}, past which the file cannot be read");
            unsupported(path, camera_id, &shown, UNDISTORT)
        })
    }

    /// The model of a name, as text files have it.
    pub fn by_name(name: &str) -> Option<Self> {
        MODELS.into_iter().find(|m| m.name == name)
    }
}
