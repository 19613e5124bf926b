//! What a run does when its device has no room: it stops growing, reduces its images or leaves the model as it is, says so, and
//! goes on.

use super::super::device_bound::{GROWTH_ENDED, SMALLER_IMAGES};
use super::super::events::{Control, Sink, TrainEvent};
use super::batch::PlannedStep;
use super::trainer::{Trainer, smaller_side_px};
use crate::backend::{StepReport, StepRequest};
use crate::text::format_count;
use crate::{Error, Result, Warning};

/// Smaller side below which images are not reduced for the device, in pixels.
const LEAST_SIDE_PX: f64 = 32.0;

/// Code of the warning that a round of pruning did not fit.
const NOT_PRUNED: &str = "not-pruned";

impl Trainer<'_> {
    /// Plans a batch and does its steps, on smaller images where the first does not fit. Returns those that were done, with their
    /// reports.
    pub(super) fn fitting_batch(&mut self) -> Result<(Vec<PlannedStep>, Vec<StepReport>)> {
        // What smaller images replace.
        let mut before = None;
        loop {
            let mut batch = self.plan_batch()?;
            let requests: Vec<StepRequest<'_>> = batch.iter().map(|planned| self.request(planned)).collect();
            let outcome = self.backend.steps(&requests);
            drop(requests);
            match outcome {
                Ok(reports) if (1..=batch.len()).contains(&reports.len()) => {
                    batch.truncate(reports.len());
                    return Ok((batch, reports));
                }
                Err(Error::DeviceFull(what)) if self.can_reduce_images() => {
                    before.get_or_insert_with(|| (self.state.device, self.state.view_losses.clone()));
                    self.reduce_images(&what);
                }
                outcome => {
                    if let (Err(Error::DeviceFull(_)), Some((device, losses))) = (&outcome, before) {
                        // No size fits: a device with more room goes on from here as if this had not happened.
                        self.state.device = device;
                        self.begin_stage(self.state.stage_step);
                        self.state.view_losses = losses;
                    }
                    // A checkpoint saved now must include the steps done before the backend failed. What they showed of
                    // the exposures is lost: their views keep their maps for another epoch.
                    if let Ok((_, adam)) = self.backend.read_back() {
                        let done = adam.step.saturating_sub(self.state.step) as usize;
                        self.advance(done.min(batch.len()));
                    }
                    let reports = outcome?.len();
                    return Err(Error::Device(format!("{reports} reports for {} steps", batch.len())));
                }
            }
        }
    }

    fn can_reduce_images(&self) -> bool {
        f64::from(smaller_side_px(&self.cameras)) / self.stage.render_scale > LEAST_SIDE_PX
    }

    fn reduce_images(&mut self, what: &str) {
        let step = self.state.step;
        let is_first = self.state.device.least_scale == 1.0;
        self.state.device.end_growth(self.size, step);
        self.state.device.reduce_images(self.stage.render_scale);
        self.begin_stage(self.state.stage_step);
        if is_first {
            self.add_warning(
                SMALLER_IMAGES,
                format!(
                    "step {}: {what}; from here on the model does not grow, and it is trained on smaller images where steps do \
                     not fit: lower --max-resolution or --budget-params",
                    step + 1
                ),
            );
        }
    }

    /// Warns that growth ended, if it ended just now.
    pub(super) fn growth_ended(&mut self, what: &str) {
        let (step, size) = (self.state.step, self.size);
        if self.state.device.ended_step != step {
            return;
        }
        self.add_warning(
            GROWTH_ENDED,
            format!(
                "step {step}: no splats are added to the {} of the model ({} parameters), because the device has no room for more: {what}; \
                 --budget-params {} keeps within it, another --device or a lower --max-resolution may hold more",
                format_count(size.splats as u64),
                format_count(size.params as u64),
                size.params
            ),
        );
    }

    /// Warns that a round of pruning was left out.
    pub(super) fn not_pruned(&mut self, what: &str) {
        let step = self.state.step;
        self.add_warning(NOT_PRUNED, format!("step {step}: a round of pruning was left out: {what}"));
    }

    fn add_warning(&mut self, code: &str, message: String) {
        self.warnings.push(Warning { code: code.to_owned(), message, count: 1 });
    }

    /// Reports the warnings so far.
    pub(super) fn warn(&mut self, sink: Sink<'_>) -> Result<Control> {
        let mut control = Control::Continue;
        for warning in std::mem::take(&mut self.warnings) {
            control = control.max(sink(TrainEvent::Warning(warning))?);
        }
        Ok(control)
    }
}
