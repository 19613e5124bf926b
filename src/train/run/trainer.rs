//! A training under way, and its time.

use super::super::config::{LengthChange, TrainConfig};
use super::super::eta::Eta;
use super::super::pacing::Timing;
use super::super::schedule::Schedule;
use super::super::state::{SizeFigures, TrainState};
use super::super::targets::Targets;
use super::super::window::Stage;
use crate::Warning;
use crate::backend::{Backend, DeviceLimits};
use crate::camera::Camera;
use crate::clock::process_cpu_secs;
use crate::frequency::FrequencySchedule;
use crate::rounding::Rounder;
use crate::views::ViewSource;

/// A training under way.
pub struct Trainer<'a> {
    pub timing: &'a Timing<'a>,
    /// Changes of the length, those of the settings and those decided since.
    pub plan: Vec<LengthChange>,
    pub config: &'a TrainConfig,
    pub backend: &'a mut dyn Backend,
    /// Rounds the model if its file has a wanted size.
    pub rounder: Option<&'a mut dyn Rounder>,
    pub views: &'a dyn ViewSource,
    pub train_views: Vec<usize>,
    pub test_views: Vec<usize>,
    pub schedule: Schedule,
    pub frequency: FrequencySchedule,
    pub limits: DeviceLimits,
    pub eta: Eta,
    /// Cameras of the training views, at full size.
    pub cameras: Vec<Camera>,
    pub stage: Stage,
    pub targets: Targets,
    /// Splats and texels of the backend's model; the model of the state is that of the last checkpoint.
    pub size: SizeFigures,
    pub state: TrainState,
    /// When the last checkpoint was made, or training began.
    pub saved_secs: f64,
    /// Warnings to be reported.
    pub warnings: Vec<Warning>,
}

/// Start of a span of training time.
pub struct Clock<'a> {
    pub timing: &'a Timing<'a>,
    pub began_secs: f64,
    pub cpu_secs: f64,
}

impl<'a> Clock<'a> {
    pub fn start(timing: &'a Timing<'a>) -> Self {
        Self { timing, began_secs: (timing.now)(), cpu_secs: process_cpu_secs() }
    }

    pub fn wall_secs(&self) -> f64 {
        (self.timing.now)() - self.began_secs
    }
}

/// Smallest side of the views, in pixels.
pub fn smaller_side_px(cameras: &[Camera]) -> u32 {
    cameras.iter().map(|c| c.pinhole.width_px.min(c.pinhole.height_px)).min().unwrap_or(1)
}
