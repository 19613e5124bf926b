//! The trainer's output: one stream of typed events for progress bars, logs, run folders and tests. The
//! consumer answers each event with whether to continue.

use super::density::DensityCounts;
use super::eta::Remaining;
use super::prune::Pruned;
use super::state::{SizeFigures, TrainState};
use crate::backend::{DeviceInfo, LossValues, RenderedImage, StepReport};
use crate::eval::Evaluation;
use crate::model::Model;
use crate::{Result, Warning};

/// The consumer's answer to an event. Of several answers to the events of a batch, the greatest counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Control {
    /// Go on training.
    Continue,
    /// To an event of a step: emit a [`TrainEvent::Snapshot`] after it, or after the batch that contains it, and go on. To events
    /// between steps the same as `Continue`. A snapshot that fails is a warning, [`super::NO_SNAPSHOT`].
    Snapshot,
    /// Stop after this step, or after the batch that contains it; the trainer emits a last
    /// [`TrainEvent::Checkpoint`].
    Stop,
}

/// Why training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// All steps are done.
    Steps,
    /// The consumer answered [`Control::Stop`].
    Consumer,
}

/// An event of a run; `step` is the number of steps done.
pub enum TrainEvent<'a> {
    /// Training is about to begin.
    Started {
        /// Device that trains.
        device: DeviceInfo,
        /// Steps already done, more than 0 in resumed runs.
        step: u32,
        /// Steps of the whole run.
        steps: u32,
        /// Number of training views.
        train_views: usize,
        /// Number of test views.
        test_views: usize,
    },
    /// A step was done. The steps of a batch are reported after it, in order, each with an even share of the
    /// batch's time.
    Step {
        /// Steps done.
        step: u32,
        /// Index of the view that was rendered.
        view: usize,
        /// Loss before the update.
        loss: LossValues,
        /// The backend's report of the step.
        report: &'a StepReport,
        /// Size of the model during the step.
        size: SizeFigures,
        /// Training time so far, evaluation and saving not counted.
        train_wall_secs: f64,
        /// CPU time of the process during the training time.
        train_cpu_secs: f64,
        /// ETA: predicted time of all that is left, to the exit of the program.
        remaining_secs: f64,
    },
    /// The length of the run was decided again, to end at its deadline.
    Planned {
        /// Steps done.
        step: u32,
        /// Last step of the run from then on.
        last_step: u32,
        /// What the rest will take.
        remaining: Remaining,
    },
    /// A density-control step was done.
    DensityControl {
        /// Steps done.
        step: u32,
        /// What the revision did.
        counts: DensityCounts,
        /// Size of the model after the revision.
        size: SizeFigures,
        /// Render scale of the stage that begins.
        render_scale: f64,
        /// Texture cap of the stage that begins, in texels.
        texture_cap: u16,
        /// Time that it took, part of the training time of the last step.
        wall_secs: f64,
    },
    /// The model was pruned, after the density-control step reported before.
    Pruned(Pruned),
    /// A test view was rendered for the evaluation that [`TrainEvent::Evaluated`] will report.
    EvalView {
        /// Steps done.
        step: u32,
        /// Index of the view.
        view: usize,
        /// The render.
        image: &'a RenderedImage,
    },
    /// The test views were evaluated.
    Evaluated {
        /// Steps done.
        step: u32,
        /// Quality figures, per view and as means.
        evaluation: &'a Evaluation,
        /// The point just added to the curve.
        point: &'a super::state::CurvePoint,
        /// Whether this is the last evaluation of the run.
        last: bool,
    },
    /// The state should be saved: periodically, at the end, and when stopped.
    Checkpoint {
        /// The state, complete enough to continue bit for bit.
        state: &'a TrainState,
        /// Whether it is only to outlive a crash: the next checkpoint replaces it.
        is_interim: bool,
    },
    /// The model that the consumer asked for with [`Control::Snapshot`]. Taking it changes no bit of the training, and does not
    /// count as training time.
    Snapshot {
        /// Steps done.
        step: u32,
        /// The model with all lazy updates done.
        model: Model,
        /// Time that reading it took.
        wall_secs: f64,
    },
    /// A problem, reported once.
    Warning(Warning),
    /// The run ended; emitted after the last evaluation and checkpoint.
    Finished {
        /// Why it ended.
        reason: StopReason,
    },
}

/// Consumer of a run's events.
pub type Sink<'a> = &'a mut dyn FnMut(TrainEvent<'_>) -> Result<Control>;
