//! How a capture is read: the options that the command line and `config.toml` set.

use super::formats::FORMATS;
use super::pose_format::PoseFormat;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Memory for decoding one photo, unless the user says otherwise.
pub(crate) const PHOTO_MEMORY_BYTES: u64 = 3 << 30;

/// A kind of pose file.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct CaptureFormat(&'static PoseFormat);

impl CaptureFormat {
    /// All of them, in the order in which they are looked for.
    pub fn all() -> impl Iterator<Item = Self> {
        FORMATS.iter().map(Self)
    }

    /// As `--format` and `config.toml` call it.
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// One line for `--help`.
    pub fn help(self) -> &'static str {
        self.0.help
    }

    /// The entry in the table of formats.
    pub(crate) fn entry(self) -> &'static PoseFormat {
        self.0
    }
}

impl PartialEq for CaptureFormat {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for CaptureFormat {}

impl FromStr for CaptureFormat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names: Vec<&str> = Self::all().map(Self::name).collect();
        let found = Self::all().find(|format| format.name() == text);
        found.ok_or_else(|| format!("unknown pose format {text:?}, expected one of {}", names.join(", ")))
    }
}

impl TryFrom<String> for CaptureFormat {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<CaptureFormat> for String {
    fn from(format: CaptureFormat) -> Self {
        format.name().to_owned()
    }
}

impl fmt::Display for CaptureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Debug for CaptureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What is made of the orientation in a photo's EXIF data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExifTurn {
    /// The photo is turned where its sides fit its camera only then.
    #[default]
    Auto,
    /// Photos are taken as stored.
    Ignore,
    /// Photos are turned as their EXIF data ask.
    Apply,
}

/// The focal length of the pinhole image that a photo is undistorted to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UndistortFocal {
    /// That of the lens: the middle of the photo keeps its scale.
    #[default]
    Lens,
    /// A shorter one where the pinhole image keeps more of the photo then.
    Auto,
}

/// How a capture is read. Each default names its source, as in `TrainConfig`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct LoadOptions {
    /// Pose format. Default `None`: the first found, in the order of [`CaptureFormat::all`].
    pub format: Option<CaptureFormat>,
    /// Folder of the photos, absolute or relative to the capture (`images_4`). Default `None`: `images` (COLMAP's
    /// layout).
    pub images: Option<PathBuf>,
    /// Folder of the masks, absolute or relative to the capture. Default `None`: `masks` where it exists.
    pub masks: Option<PathBuf>,
    /// Whether black keeps pixels instead of white. Default off, as COLMAP's masks are.
    pub mask_invert: bool,
    /// Largest longer side of an image, in pixels; larger photos are reduced. Default 1,600 (3DGS bounds the width
    /// by as much).
    pub max_resolution: u32,
    /// Display-space colour on which photos with alpha are composited, 0 to 1. Default black (3DGS).
    pub background: [f32; 3],
    /// Whether alpha is kept, for training on changing backgrounds; colours are those over black then. Default off.
    #[serde(skip)]
    pub keep_alpha: bool,
    /// Whether cameras and points more than 20 median distances from the median are kept. Default off: one lost camera
    /// would set the scale of the capture.
    pub keep_far: bool,
    /// Every how many views one is held out, in the order of names; 0: none. A split stated by the capture takes
    /// precedence. Default 8 (paper, Experimental Setup).
    pub test_every: usize,
    /// File with the names of the views to hold out, one per line; takes precedence over every other rule.
    pub test_list: Option<PathBuf>,
    /// Whether photos are turned as their EXIF data ask. Default `auto`: pose solvers differ, and most photos show it by
    /// their sides.
    pub exif: ExifTurn,
    /// Focal length of the pinhole images that photos are undistorted to. Default that of the lens (COLMAP's undistorter
    /// changes it little).
    pub undistort_focal: UndistortFocal,
    /// Memory that decoding one photo may take, in bytes; photos that need more are refused. Default 3 GiB: 250 megapixels
    /// of a progressive JPEG or of 16 bits (measured: 250 megapixels of 8 bits take 0.8 GiB).
    pub photo_memory_bytes: u64,
    /// Memory for decoded photos, in bytes. Default 4 GiB (not measured; does not change the result).
    pub image_cache_bytes: u64,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            format: None,
            images: None,
            masks: None,
            mask_invert: false,
            max_resolution: 1600,
            background: [0.0; 3],
            keep_alpha: false,
            keep_far: false,
            test_every: 8,
            test_list: None,
            exif: ExifTurn::Auto,
            undistort_focal: UndistortFocal::Lens,
            photo_memory_bytes: PHOTO_MEMORY_BYTES,
            image_cache_bytes: 4 << 30,
        }
    }
}
