//! What reads the model while a run goes on: snapshots, evaluations, checkpoints.

use super::super::evaluate::{Evaluated, evaluate};
use super::super::events::{Control, Sink, TrainEvent};
use super::super::state::CurvePoint;
use super::trainer::{Clock, Trainer};
use crate::backend::{RenderOptions, RenderedImage};
use crate::eval::Evaluation;
use crate::{Error, Result, Warning};

/// Code of the warning that [`Control::Snapshot`] leads to where the device cannot read its model, as for want of memory.
pub const NO_SNAPSHOT: &str = "no-snapshot";

/// Code of the warning that a checkpoint was left out.
const NO_CHECKPOINT: &str = "checkpoint-not-saved";

/// Code of the warning that an evaluation has no figures.
pub const NO_TEST_FIGURES: &str = "no-test-figures";

impl Trainer<'_> {
    pub(super) fn snapshot(&mut self, sink: Sink<'_>) -> Result<Control> {
        let (clock, step) = (Clock::start(self.timing), self.state.step);
        match self.backend.read_flushed() {
            Ok(model) => {
                let wall_secs = clock.wall_secs();
                sink(TrainEvent::Snapshot { step, model, wall_secs })
            }
            // No reason to end a training: a device that is lost fails in the next step.
            Err(error) => sink(TrainEvent::Warning(Warning {
                code: NO_SNAPSHOT.to_owned(),
                message: format!("step {step}: the model cannot be shown: {error}"),
                count: 1,
            })),
        }
    }

    pub(super) fn evaluate(&mut self, last: bool, sink: Sink<'_>) -> Result<Control> {
        if self.test_views.is_empty() {
            return Ok(Control::Continue);
        }
        let step = self.state.step;
        let options = RenderOptions {
            background: self.config.background,
            sh_degree: self.schedule.sh_degree(step.max(1), self.config.sh_degree),
            geometry: false,
        };
        let mut on_view =
            |view: usize, image: &RenderedImage| sink(TrainEvent::EvalView { step, view, image });
        let outcome = evaluate(self.backend, self.views, &self.test_views, &options, &mut on_view);
        let message = match outcome {
            Ok(Evaluated::Figures(evaluation)) => return self.evaluated(evaluation, last, sink),
            Ok(Evaluated::Stopped) => return Ok(Control::Stop),
            Ok(Evaluated::Nothing) => {
                "the masks exclude every pixel of the test views: there are no test figures; check \
                 --set capture.mask-invert, or hold out other views (--test-every)"
                    .to_owned()
            }
            // Steps on smaller images go on.
            Err(Error::DeviceFull(no_room)) => format!(
                "step {step}: the device has no room for images of the test views ({}): there are no test figures; \
                 litetex eval --device cpu measures the finished run",
                no_room.what
            ),
            Err(error) => return Err(error),
        };
        sink(TrainEvent::Warning(Warning { code: NO_TEST_FIGURES.to_owned(), message, count: 1 }))
    }

    fn evaluated(&mut self, evaluation: Evaluation, last: bool, sink: Sink<'_>) -> Result<Control> {
        let step = self.state.step;
        let history = &mut self.state.history;
        let point = CurvePoint {
            step,
            wall_secs: history.train_wall_secs,
            cpu_secs: history.train_cpu_secs,
            psnr_test: evaluation.psnr,
            grad_psnr_test: evaluation.grad_psnr,
            size: self.size,
        };
        history.curve.retain(|p| p.step != step);
        history.curve.push(point.clone());
        sink(TrainEvent::Evaluated { step, evaluation: &evaluation, point: &point, last })
    }

    /// Saves a checkpoint, or warns that the device has no room to read it: the run does not depend on it.
    pub(super) fn checkpoint(&mut self, is_interim: bool, sink: Sink<'_>) -> Result<Control> {
        match self.read_state() {
            Ok(()) => self.save(is_interim, sink).map(|()| Control::Continue),
            Err(Error::DeviceFull(no_room)) => {
                // Not again after the next batch.
                self.saved_secs = (self.timing.now)();
                let (step, what) = (self.state.step, no_room.what);
                sink(TrainEvent::Warning(Warning {
                    code: NO_CHECKPOINT.to_owned(),
                    message: format!(
                        "step {step}: the device has no room to read a checkpoint ({what}): --resume would go on from an earlier \
                         one; lower --budget-params, or use another --device"
                    ),
                    count: 1,
                }))
            }
            Err(error) => Err(error),
        }
    }

    /// Saves the checkpoint at the end of the run, which has no result without it.
    pub(super) fn last_checkpoint(&mut self, sink: Sink<'_>) -> Result<()> {
        self.read_state()?;
        self.save(false, sink)
    }

    /// Reads all of the state that the backend holds, or leaves the state as it is.
    fn read_state(&mut self) -> Result<()> {
        let (model, adam) = self.backend.read_back()?;
        let window = self.backend.read_statistics()?;
        (self.state.model, self.state.adam, self.state.window) = (model, adam, window);
        Ok(())
    }

    /// Saves the state that was read last.
    pub(super) fn save(&mut self, is_interim: bool, sink: Sink<'_>) -> Result<()> {
        sink(TrainEvent::Checkpoint { state: &self.state, is_interim })?;
        self.saved_secs = (self.timing.now)();
        Ok(())
    }
}
