//! `summary.json`: the result of a run in one object, documented in `docs/summary-schema.md`. Names are
//! part of the contract with whoever reads it; a change of meaning raises the number in `SCHEMA`.

use super::profile::Profile;
use litetex_gs::backend::DeviceInfo;
use litetex_gs::eval::{Evaluation, ViewQuality};
use litetex_gs::train::density::Components;
use litetex_gs::train::{CurvePoint, Policy};
use litetex_gs::{Result, Warning, atomic_file};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Identifier and version of the schema.
pub const SCHEMA: &str = "litetex-summary/2";
/// Why LPIPS is null.
pub const LPIPS_REASON: &str =
    "needs network weights that are not shipped: compute it from the images in eval/";

/// The result of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// [`SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// Name of the capture's folder.
    pub scene: String,
    /// What was trained on.
    pub capture: CaptureFigures,
    /// How images were brought to size.
    pub resample: String,
    /// Display-space colour behind everything.
    pub background: [f32; 3],
    /// Where it ran.
    pub device: DeviceInfo,
    /// Seed.
    pub seed: u64,
    /// Steps done.
    pub steps: u32,
    /// Steps of the schedule.
    pub steps_planned: u32,
    /// Set of defaults that the settings started from.
    pub profile: Profile,
    /// Allocation of splats and texels.
    pub policy: Policy,
    /// Parts of the method that were on.
    #[serde(default)]
    pub components: Components,
    /// Parts of the method that could not act in a run of this length.
    pub inactive: Vec<String>,
    /// Splats by the longer side of their map: none, 2, up to 4, 8, ... 256 texels.
    pub map_sides: Vec<usize>,
    /// `steps`, `time` or `interrupted`.
    pub stopped_by: String,
    /// Of the last evaluation; null without test views.
    pub quality: Option<Quality>,
    /// Size of the model.
    pub size: Size,
    /// Times.
    pub time: Times,
    /// Rendering speed on the test views; null if none was rendered.
    pub fps: Option<Fps>,
    /// Evaluations on the way.
    pub curve: Vec<CurvePoint>,
    /// Null for an uninterrupted run.
    pub resumed: Option<Resumed>,
    /// Largest resident memory of the process; null where the system does not tell.
    pub memory_peak_bytes: Option<u64>,
    /// Everything that was warned of.
    pub warnings: Vec<Warning>,
}

/// What was trained on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureFigures {
    /// Folder.
    pub path: String,
    /// `colmap` or `transforms`.
    pub format: String,
    /// Views trained on.
    pub train_views: usize,
    /// Views held out.
    pub test_views: usize,
    /// Largest width at which views are trained and evaluated.
    pub width_px: u32,
    /// Largest height.
    pub height_px: u32,
    /// Sparse points in the capture.
    pub points: usize,
}

/// Figures of the test views, means over the views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// dB
    pub psnr: f64,
    /// dB
    pub grad_psnr: f64,
    /// With zero padding.
    pub ssim_3dgs: f64,
    /// Valid region.
    pub ssim_valid: f64,
    /// Mean FLIP error.
    pub flip: f64,
    /// Always null.
    pub lpips: Option<f64>,
    /// Why.
    pub lpips_reason: String,
    /// In the order of the views.
    pub per_view: Vec<ViewQuality>,
}

impl From<&Evaluation> for Quality {
    fn from(e: &Evaluation) -> Self {
        Self {
            psnr: e.psnr,
            grad_psnr: e.grad_psnr,
            ssim_3dgs: e.ssim_3dgs,
            ssim_valid: e.ssim_valid,
            flip: e.flip,
            lpips: None,
            lpips_reason: LPIPS_REASON.to_owned(),
            per_view: e.per_view.clone(),
        }
    }
}

/// Size of the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Size {
    /// Number of splats.
    pub splats: usize,
    /// Number of texels of all texture maps.
    pub texels: usize,
    /// 59 per splat and 3 per texel, as published.
    pub params: usize,
    /// Of the last checkpoint, optimiser included.
    pub checkpoint_bytes: u64,
}

/// Times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Training, evaluation and saving not counted.
    pub train_wall_secs: f64,
    /// CPU time of the process within it.
    pub train_cpu_secs: f64,
    /// Time of density-control steps within it: reading the model back, deciding, changing it.
    #[serde(default)]
    pub density_control_wall_secs: f64,
    /// Time of the analysis of the photos' spectra within it.
    #[serde(default)]
    pub analysis_wall_secs: f64,
    /// From the start of the command to this file, earlier parts of a resumed run included.
    pub total_wall_secs: f64,
}

/// Rendering speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fps {
    /// Images per second, median.
    pub median: f64,
    /// The slowest twentieth.
    pub p5: f64,
    /// Images rendered.
    pub renders: usize,
    /// Largest width.
    pub width_px: u32,
    /// Largest height.
    pub height_px: u32,
}

/// How a resumed run relates to the one before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Resumed {
    /// Step of the checkpoint.
    pub from_step: u32,
    /// Whether settings differ, so that the result is not that of an uninterrupted run.
    pub new_schedule: bool,
    /// The settings that differ.
    pub changed: Vec<String>,
}

impl Summary {
    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// [`litetex_gs::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text = serde_json::to_vec_pretty(self).map_err(|e| litetex_gs::Error::io(path, e.into()))?;
        text.push(b'\n');
        atomic_file::write(path, &text)
    }

    /// Reads the file.
    ///
    /// # Errors
    /// [`litetex_gs::Error::Io`], [`litetex_gs::Error::InvalidInput`].
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read(path).map_err(|e| litetex_gs::Error::io(path, e))?;
        serde_json::from_slice(&text).map_err(|e| litetex_gs::Error::invalid(path, e.to_string()))
    }
}
