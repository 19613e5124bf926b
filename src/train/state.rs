//! Everything that a run needs to continue bit for bit, and the curve that it has drawn so far.

use super::density::Life;
use crate::backend::WindowStatistics;
use crate::model::{AdamState, Model};
use crate::frequency::SplatBudget;
use serde::{Deserialize, Serialize};

/// One evaluation on the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Steps done.
    pub step: u32,
    /// Training time, evaluation and saving not counted.
    pub wall_secs: f64,
    /// CPU time of the process within it.
    pub cpu_secs: f64,
    /// Mean PSNR of the test views, dB.
    pub psnr_test: f64,
    /// Mean gradient-PSNR of the test views, dB.
    pub grad_psnr_test: f64,
    /// Splats.
    pub splats: usize,
    /// Texels.
    pub texels: usize,
}

/// Times and curve: what a resumed run carries on besides the state proper.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrainHistory {
    /// Training time so far.
    pub train_wall_secs: f64,
    /// CPU time within it.
    pub train_cpu_secs: f64,
    /// Time of density-control steps within the training time.
    #[serde(default)]
    pub density_control_wall_secs: f64,
    /// Time of the analysis of the photos' spectra within the training time.
    #[serde(default)]
    pub analysis_wall_secs: f64,
    /// Time of the whole program until the state was saved: loading, evaluation and files included.
    pub total_wall_secs: f64,
    /// Evaluations so far.
    pub curve: Vec<CurvePoint>,
}

/// State of a run between two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainState {
    /// Steps done.
    pub step: u32,
    /// The scene.
    pub model: Model,
    /// The optimiser.
    pub adam: AdamState,
    /// Views of the current epoch, in the order in which they are drawn.
    pub epoch_order: Vec<u32>,
    /// Views of the current epoch already used.
    pub epoch_used: u32,
    /// Epochs begun; the order of an epoch follows from the seed and this.
    pub epochs: u32,
    /// What is known of each splat besides its parameters.
    pub lives: Vec<Life>,
    /// Views whose renders count in the window of statistics, in the order of their steps.
    pub window_views: Vec<u32>,
    /// Sums of that window; as of the last checkpoint.
    pub window: WindowStatistics,
    /// Step at which the scheduler was last asked for scale and cap.
    pub stage_step: u32,
    /// Step after which the structure was last revised; a failure may come before the revision that is due.
    pub revised_step: u32,
    /// Pace of the splits.
    pub pace: SplatBudget,
    /// Times and curve.
    pub history: TrainHistory,
}

impl TrainState {
    /// A run that has not begun.
    pub fn fresh(model: Model) -> Self {
        Self {
            step: 0,
            adam: AdamState::zeros(&model),
            model,
            epoch_order: Vec::new(),
            epoch_used: 0,
            epochs: 0,
            lives: Vec::new(),
            window_views: Vec::new(),
            window: WindowStatistics::default(),
            stage_step: 0,
            revised_step: 0,
            pace: SplatBudget::new(0),
            history: TrainHistory::default(),
        }
    }
}
