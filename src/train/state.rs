//! The state from which a run continues bit for bit, and its history of times and evaluations.

use super::density::{Growth, SplatHistory};
use super::device_bound::DeviceBound;
use super::exposure::Exposures;
use super::prune::Pruned;
pub use super::size_figures::SizeFigures;
use crate::backend::WindowStatistics;
use crate::frequency::SplatBudget;
use crate::model::{AdamState, Model};
use crate::rounding::LastRounding;
use serde::{Deserialize, Serialize};

/// One evaluation of the test views during a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Steps done.
    pub step: u32,
    /// Training time, evaluation and saving not counted.
    pub wall_secs: f64,
    /// CPU time of the process during the training time.
    pub cpu_secs: f64,
    /// Mean PSNR of the test views, dB.
    pub psnr_test: f64,
    /// Mean gradient-PSNR of the test views, dB.
    pub grad_psnr_test: f64,
    /// Size of the model.
    #[serde(flatten)]
    pub size: SizeFigures,
}

/// Times and evaluations, which a resumed run continues but which do not shape the result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrainHistory {
    /// Training time, evaluation and saving not counted.
    pub train_wall_secs: f64,
    /// CPU time of the process during the training time.
    pub train_cpu_secs: f64,
    /// The part of the training time spent on density-control steps.
    #[serde(default)]
    pub density_control_wall_secs: f64,
    /// The part of that spent on pruning after growth.
    #[serde(default)]
    pub prune_wall_secs: f64,
    /// The part of the training time spent on rounding.
    #[serde(default)]
    pub rounding_wall_secs: f64,
    /// The part of the training time spent on the analysis of the photos' spectra.
    #[serde(default)]
    pub analysis_wall_secs: f64,
    /// Time of the whole program until the state was saved, with loading, evaluation and files.
    pub total_wall_secs: f64,
    /// Evaluations so far.
    pub curve: Vec<CurvePoint>,
    /// Rounds of pruning so far.
    #[serde(default)]
    pub pruned: Vec<Pruned>,
}

/// State of a run between two steps. The model and the optimiser are those of the last checkpoint while the
/// backend trains.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainState {
    /// Steps done.
    pub step: u32,
    /// Splats and texture maps.
    pub model: Model,
    /// Moments of the optimiser.
    pub adam: AdamState,
    /// Views of the current epoch, in the order in which they are drawn.
    pub epoch_order: Vec<u32>,
    /// Views of the current epoch already used.
    pub epoch_used: u32,
    /// Epochs begun; with the seed it determines the order of an epoch.
    pub epochs: u32,
    /// History of each splat; empty before the first step.
    pub histories: Vec<SplatHistory>,
    /// Views whose renders count in the statistics window, in the order of their steps.
    pub window_views: Vec<u32>,
    /// Sums of that window, as of the last checkpoint.
    pub window: WindowStatistics,
    /// Step at which render scale and texture cap were last set.
    pub stage_step: u32,
    /// Last step after which density control ran. A failure may come between a step and the revision due
    /// after it.
    pub revised_step: u32,
    /// Exposures of the photos.
    pub exposures: Exposures,
    /// Target number of splats.
    pub pace: SplatBudget,
    /// How growth has paid so far.
    pub growth: Growth,
    /// What the run keeps to because its device holds no more.
    pub device: DeviceBound,
    /// Loss of each view when it was last rendered at the current image size; 0: not yet. Empty before the first step.
    pub view_losses: Vec<f32>,
    /// The last rounding, if the model is trained as its file will hold it.
    pub rounded: Option<LastRounding>,
    /// Times and evaluations.
    pub history: TrainHistory,
}

impl TrainState {
    /// The state of a run before its first step.
    pub fn fresh(model: Model) -> Self {
        Self {
            step: 0,
            adam: AdamState::zeros(&model),
            model,
            epoch_order: Vec::new(),
            epoch_used: 0,
            epochs: 0,
            histories: Vec::new(),
            window_views: Vec::new(),
            window: WindowStatistics::default(),
            stage_step: 0,
            revised_step: 0,
            exposures: Exposures::default(),
            pace: SplatBudget::new(0),
            growth: Growth::default(),
            device: DeviceBound::default(),
            view_losses: Vec::new(),
            rounded: None,
            history: TrainHistory::default(),
        }
    }
}
