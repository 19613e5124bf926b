//! What the trainer tells: one stream of typed events that progress bars, logs, run folders and tests
//! consume. The consumer answers whether to go on.

use super::density::DensityCounts;
use super::state::TrainState;
use crate::Warning;
use crate::backend::{DeviceInfo, LossValues, RenderedImage, StepReport};
use crate::eval::Evaluation;

/// Consumer's answer to an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop after this step, or after the batch that the backend has done with it; the trainer emits a
    /// last [`TrainEvent::Checkpoint`].
    Stop,
}

/// Why training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// All steps done.
    Steps,
    /// `max_time_secs` reached.
    Time,
    /// The consumer said so.
    Consumer,
}

/// An event.
pub enum TrainEvent<'a> {
    /// Before the first step.
    Started {
        /// Where it runs.
        device: DeviceInfo,
        /// Steps already done (resumed runs).
        step: u32,
        /// Steps in all.
        steps: u32,
        /// Views that are trained on.
        train_views: usize,
        /// Views that are held out.
        test_views: usize,
    },
    /// Once for each step, in order; after the batch where the backend takes several steps at once, each
    /// of which then counts with an even share of the batch's time.
    Step {
        /// Steps done.
        step: u32,
        /// View of this step.
        view: usize,
        /// Loss before the update.
        loss: LossValues,
        /// Everything else that the step reported.
        report: &'a StepReport,
        /// Splats.
        num_splats: usize,
        /// Texels.
        num_texels: usize,
        /// Training time so far, evaluation and saving not counted.
        train_wall_secs: f64,
        /// CPU time of the process within it.
        train_cpu_secs: f64,
        /// Training time that the steps after it will take, as far as can be told.
        remaining_secs: f64,
    },
    /// A density-control step was done.
    DensityControl {
        /// Steps done.
        step: u32,
        /// What it did.
        counts: DensityCounts,
        /// Splats after it.
        num_splats: usize,
        /// Texels after it.
        num_texels: usize,
        /// Full size of the images over their size from here on.
        render_scale: f64,
        /// Most texels a side of any map from here on.
        texture_cap: u16,
        /// Time that it took, part of the training time of the last step.
        wall_secs: f64,
    },
    /// One test view was rendered in an evaluation; [`TrainEvent::Evaluated`] follows.
    EvalView {
        /// Steps done.
        step: u32,
        /// View.
        view: usize,
        /// The image.
        image: &'a RenderedImage,
    },
    /// The test views were evaluated.
    Evaluated {
        /// Steps done.
        step: u32,
        /// Figures.
        evaluation: &'a Evaluation,
        /// The point just added to the curve.
        point: &'a super::state::CurvePoint,
        /// Whether this is the last evaluation of the run.
        last: bool,
    },
    /// The state should be saved: periodically, at the end and when stopped.
    Checkpoint {
        /// Everything needed to continue bit for bit.
        state: &'a TrainState,
    },
    /// Something to tell once.
    Warning(Warning),
    /// After the last evaluation and checkpoint.
    Finished {
        /// Why.
        reason: StopReason,
    },
}
