//! How a capture is read: the options that the command line and `config.toml` fill.

use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Kind of pose file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CaptureFormat {
    /// A COLMAP sparse model, binary or text.
    Colmap,
    /// `transforms.json` of nerfstudio and instant-ngp, `transforms_train.json` of Blender scenes.
    Transforms,
    /// The CSV export of RealityCapture / RealityScan.
    RealityCapture,
}

impl std::fmt::Display for CaptureFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Colmap => "colmap",
            Self::Transforms => "transforms",
            Self::RealityCapture => "reality-capture",
        })
    }
}

/// How a capture is read. Each default names its source, as in `TrainConfig`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct LoadOptions {
    /// Pose format. Default `None`: a sparse model takes precedence over `transforms.json`, and that over CSV.
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
    /// Every how many views one is held out, in the order of names; 0: none. A split stated by the capture takes
    /// precedence. Default 8 (paper, Experimental Setup).
    pub test_every: usize,
    /// File with the names of the views to hold out, one per line; takes precedence over every other rule.
    pub test_list: Option<PathBuf>,
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
            test_every: 8,
            test_list: None,
            image_cache_bytes: 4 << 30,
        }
    }
}
