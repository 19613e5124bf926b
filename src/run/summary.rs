//! `summary.json`: the result of a run in one object, documented in `docs/summary-schema.md`. Other programs rely on
//! its names; a change of meaning raises the number in `SCHEMA`.

use super::layers::LayersPerPixel;
use super::profile::Profile;
use crate::backend::DeviceInfo;
use crate::eval::Evaluation;
use crate::train::density::{Components, Growth};
use crate::train::{CurvePoint, DeviceBound, Policy, Pruned};
use crate::{Result, Warning, atomic_file, input_file};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Identifier and version of the schema.
pub const SCHEMA: &str = "litetex-summary/5";
/// Largest file that is read; it has a few numbers per view and evaluation.
pub const FILE_BYTES_MAX: u64 = 1 << 30;
/// `stopped_by` of a run that the user ended.
pub(super) const INTERRUPTED: &str = "interrupted";
/// Why LPIPS is null.
pub const LPIPS_REASON: &str =
    "needs network weights that are not shipped: compute it from the images in eval/";

/// The result of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// `SCHEMA`.
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// Name of the capture's folder.
    pub scene: String,
    /// The capture.
    pub capture: CaptureFigures,
    /// Filter by which photos were resized.
    pub resample: String,
    /// Colour of the background, display space.
    pub background: [f32; 3],
    /// Device that it ran on.
    pub device: DeviceInfo,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Steps done.
    pub steps: u32,
    /// Steps of the whole run, as last planned.
    pub steps_planned: u32,
    /// Profile that the settings started from.
    pub profile: Profile,
    /// Policy of allocation.
    pub policy: Policy,
    /// Parts of the method that were on.
    pub components: Components,
    /// Parts of the method that could not act in a run of this length.
    pub inactive: Vec<String>,
    /// Training views whose loss stood out at the end, worst first.
    pub outlying_views: Vec<String>,
    /// Number of splats by the longer side of their map: none, 2, up to 4, 8, ... 256 texels.
    pub map_sides: Vec<usize>,
    /// `steps` or `interrupted`.
    pub stopped_by: String,
    /// Figures of the last evaluation; null without test views.
    pub quality: Option<TestFigures>,
    /// Size of the model.
    pub size: Size,
    /// Layers per pixel over the scene's cameras; null after an interruption.
    pub layers_per_pixel: Option<LayersPerPixel>,
    /// The end of growth.
    pub growth: GrowthFigures,
    /// Rounds of pruning after growth.
    pub pruned: Vec<Pruned>,
    /// Times.
    pub time: Times,
    /// Rendering speed on the test views; null if none was rendered.
    pub fps: Option<Fps>,
    /// All evaluations.
    pub curve: Vec<CurvePoint>,
    /// Null for an uninterrupted run.
    pub resumed: Option<Resumed>,
    /// Largest resident memory of the process; null where the system does not report it.
    pub memory_peak_bytes: Option<u64>,
    /// All warnings.
    pub warnings: Vec<Warning>,
}

/// The end of growth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GrowthFigures {
    /// Step after which growth ended; null if it did not.
    pub ended_step: Option<u32>,
    /// What ended it; null if it did not end.
    pub ended_by: Option<EndOfGrowth>,
}

/// What ended growth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndOfGrowth {
    /// More parameters lowered the training error too little.
    Need,
    /// The device had no room for more.
    Device,
    /// The steps of density control that may add were over.
    Timetable,
}

impl GrowthFigures {
    /// The figures after a step, of a run that may grow until `densify_until`.
    pub fn new(growth: &Growth, device: &DeviceBound, step: u32, densify_until: u32) -> Self {
        let ends = [
            growth.has_ended().then_some((growth.ended_step, EndOfGrowth::Need)),
            (device.ended_step > 0).then_some((device.ended_step, EndOfGrowth::Device)),
            (step >= densify_until).then_some((densify_until, EndOfGrowth::Timetable)),
        ];
        let ended = ends.into_iter().flatten().min_by_key(|&(step, _)| step);
        Self { ended_step: ended.map(|(step, _)| step), ended_by: ended.map(|(_, by)| by) }
    }
}

/// The capture that was trained on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureFigures {
    /// Its folder.
    pub path: String,
    /// Format of the poses, such as `colmap`.
    pub format: String,
    /// Number of training views.
    pub train_views: usize,
    /// Number of test views.
    pub test_views: usize,
    /// Largest width at which views are trained and evaluated.
    pub width_px: u32,
    /// Largest height of views.
    pub height_px: u32,
    /// Number of sparse points in the capture.
    pub points: usize,
}

/// Means over the test views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestFigures {
    /// Those of this program.
    #[serde(flatten)]
    pub evaluation: Evaluation,
    /// Always null; `lpips_reason` says why.
    pub lpips: Option<f64>,
    /// Why.
    pub lpips_reason: String,
}

impl From<&Evaluation> for TestFigures {
    fn from(evaluation: &Evaluation) -> Self {
        Self { evaluation: evaluation.clone(), lpips: None, lpips_reason: LPIPS_REASON.to_owned() }
    }
}

/// Size of the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Size {
    /// Number of splats.
    pub splats: usize,
    /// Number of texels of all texture maps.
    pub texels: usize,
    /// Number of SH coefficients of all splats, RGB as one; 16 per splat at degree 3.
    pub sh_coefficients: usize,
    /// Number of splats with a texture map.
    pub maps: usize,
    /// Floats that the model holds.
    pub params: usize,
    /// 59 per splat and 3 per texel, the count of the paper's tables.
    pub params_published: usize,
    /// Sizes of files of the scene; `None` after an interruption.
    pub disk: Option<DiskBytes>,
}

/// Sizes of `.ltgs` files of the scene without cameras, at the standard quantisation steps of the quality: `export` looks
/// for coarser ones by rendering.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiskBytes {
    /// Bytes at quality `balanced`.
    pub ltgs_balanced: usize,
    /// Bytes at quality `tiny`.
    pub ltgs_tiny: usize,
}

/// Times of a run, seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Training, without evaluation and saving.
    pub train_wall_secs: f64,
    /// CPU time of the process within it.
    pub train_cpu_secs: f64,
    /// Share of density control in the training time: reading the model back, planning and carrying out the plan.
    pub density_control_wall_secs: f64,
    /// Part of that for pruning after growth: probing, trials and checks.
    pub prune_wall_secs: f64,
    /// Share of rounding the model as its file will hold it in the training time.
    pub rounding_wall_secs: f64,
    /// Share of the analysis of the photos' spectra in the training time.
    pub analysis_wall_secs: f64,
    /// From the start of the command to the writing of this file, with the earlier parts of a resumed run.
    pub total_wall_secs: f64,
}

/// Speed of rendering the test views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fps {
    /// Median, images per second.
    pub median: f64,
    /// Fifth percentile: 95 % of the images are rendered faster.
    pub p5: f64,
    /// Number of images rendered.
    pub renders: usize,
    /// Largest width of views.
    pub width_px: u32,
    /// Largest height of views.
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
    /// Writes `summary.json`, whole or not at all.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut text = serde_json::to_vec_pretty(self).map_err(|e| crate::Error::io(path, e.into()))?;
        text.push(b'\n');
        Ok(atomic_file::write(path, &text)?)
    }

    /// Whether the user ended the run before its last step.
    pub fn is_interrupted(&self) -> bool {
        self.stopped_by == INTERRUPTED
    }

    /// Reads `summary.json`.
    ///
    /// # Errors
    /// [`crate::Error::Io`], [`crate::Error::InvalidInput`], [`crate::Error::Unsupported`] if it is too
    /// large.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input_file::read(path, FILE_BYTES_MAX)?;
        serde_json::from_slice(&text).map_err(|e| crate::Error::invalid(path, e.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summaries_say_what_ended_growth() {
        let ended = |ended_step: u32, by_device: u32, step: u32| {
            let growth = Growth { ended_step, ..Growth::default() };
            let device = DeviceBound { ended_step: by_device, ..DeviceBound::default() };
            let figures = GrowthFigures::new(&growth, &device, step, 70);
            (figures.ended_step, figures.ended_by)
        };
        assert_eq!(ended(0, 0, 69), (None, None));
        assert_eq!(ended(0, 0, 70), (Some(70), Some(EndOfGrowth::Timetable)));
        // What ended first counts.
        assert_eq!(ended(40, 0, 100), (Some(40), Some(EndOfGrowth::Need)));
        assert_eq!(ended(40, 30, 100), (Some(30), Some(EndOfGrowth::Device)));
    }
}
