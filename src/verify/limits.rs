//! Limits by quality: how much a file may differ from its scene.

use litetex_exporters::{Contents, Format, Quality};
use serde::Serialize;
use std::path::Path;

/// Bounds on the differences between a file's images and its scene's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QualityLimits {
    /// No value may differ at all.
    pub exact: bool,
    /// Most PSNR on photos that may be lost, mean over the views, dB.
    pub max_loss_db: Option<f64>,
    /// Most PSNR on photos that may be lost in any one view, dB.
    pub max_loss_worst_db: Option<f64>,
    /// Least PSNR of the file's images against the scene's, mean over the views, dB.
    pub min_psnr: Option<f64>,
}

impl QualityLimits {
    /// No limit at all.
    pub const NONE: Self = Self { exact: false, max_loss_db: None, max_loss_worst_db: None, min_psnr: None };

    /// What a quality guarantees.
    pub fn of(quality: Quality) -> Self {
        let bounded = |mean, worst, psnr| Self {
            exact: false,
            max_loss_db: Some(mean),
            max_loss_worst_db: Some(worst),
            min_psnr: Some(psnr),
        };
        match quality {
            Quality::Lossless => Self { exact: true, ..Self::NONE },
            Quality::Balanced => bounded(0.02, 0.05, 48.0),
            Quality::Tiny => bounded(0.10, 0.25, 40.0),
            Quality::Custom => Self::NONE,
        }
    }

    /// What a file that was read has to keep: the limits of the quality it states, else those of its format.
    pub fn of_file(path: &Path, contents: &Contents) -> Self {
        match contents.quality {
            Some(quality) => Self::of(quality),
            None => Self::of_format(Format::from_path(path)),
        }
    }

    /// For formats that state no quality. Those without textures are compared with the untextured scene;
    /// measured on the sample: PLY 100 dB (the cap), SPZ 41 dB with the bits of `tiny`, 52 dB with all.
    fn of_format(format: Option<Format>) -> Self {
        match format {
            Some(Format::Ply) => Self { min_psnr: Some(60.0), ..Self::NONE },
            Some(Format::Spz) => Self { min_psnr: Some(30.0), ..Self::NONE },
            _ => Self::of(Quality::Lossless),
        }
    }
}
