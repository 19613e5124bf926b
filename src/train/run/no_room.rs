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

/// Code of the warning that numbers were not rounded for a file of a wanted size.
const NOT_ROUNDED: &str = "not-rounded";

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
                Err(Error::DeviceFull(no_room)) if self.can_reduce_images() => {
                    before.get_or_insert_with(|| (self.state.device, self.state.view_losses.clone()));
                    self.reduce_images(&no_room.what);
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
                    "step {}: the device has no room for a step ({}): from here on the model does not grow, and images are smaller \
                     where steps do not fit; lower --max-resolution or --budget-params, or use another --device",
                    step + 1,
                    what
                ),
            );
        }
    }

    /// Warns that growth ended, if it ended just now.
    pub(super) fn growth_ended(&mut self, what: &str) {
        let (step, size, device) = (self.state.step, self.size, &self.state.device);
        if device.ended_step != step {
            return;
        }
        let (splats, params) = (format_count(size.splats as u64), format_count(size.params as u64));
        // Where pairs or splats ended it, maps may go on growing.
        let stays = match device.budget.max_params {
            Some(_) => format!("the model stays at {splats} splats and {params} parameters"),
            None => format!("the model gets no more splats than its {splats} (now {params} parameters)"),
        };
        let remedy = match self.fitting_budget(size.params) {
            Some(params) => format!("--budget-params {params} keeps within it, another --device"),
            None => "another --device".to_owned(),
        };
        let message = format!(
            "step {step}: the device has no room for a larger model ({}): {stays}; {remedy} or a lower --max-resolution may hold more",
            what
        );
        self.add_warning(GROWTH_ENDED, message);
    }

    /// The budget, below the user's own, with which growth keeps within this number of parameters.
    fn fitting_budget(&self, params: usize) -> Option<usize> {
        let density = &self.config.density;
        // While a run prunes, growth may exceed the budget.
        let overshoot = if self.schedule.prune_rounds > 0 { density.overshoot } else { 1.0 };
        let fitting = (params as f64 / overshoot) as usize;
        Some(fitting).filter(|fitting| self.config.budget.max_params.is_none_or(|most| *fitting < most))
    }

    /// Warns that a round of pruning was left out.
    pub(super) fn not_pruned(&mut self, what: &str) {
        let remedy = match self.config.most_params() {
            Some(_) => "lower density.overshoot or --budget-params",
            None => "set --budget-params",
        };
        let message = format!(
            "step {}: the device has no room for a round of pruning ({}): it was left out; {remedy}, or use another --device",
            self.state.step, what
        );
        self.add_warning(NOT_PRUNED, message);
    }

    /// Warns that a rounding before the last was left out.
    pub(super) fn not_rounded(&mut self, what: &str) {
        let message = format!(
            "step {}: the device has no room to round the model for its file ({what}): it is trained with other numbers until the \
             next rounding; lower --max-size, or use another --device",
            self.state.step
        );
        self.add_warning(NOT_ROUNDED, message);
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
