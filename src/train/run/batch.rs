//! Batches: the steps that go to the backend at once.

use super::super::background::background_of;
use super::super::config::{Exposure, TrainConfig};
use super::super::order::ViewOrder;
use super::trainer::Trainer;
use crate::Result;
use crate::backend::{StepRequest, TargetImage};
use std::sync::Arc;

/// Photos made ahead by the end of a batch, given its steps.
pub fn photos_ahead(batch_steps: usize) -> usize {
    batch_steps.max(4)
}

/// A step of the next batch, with its photo.
pub struct PlannedStep {
    pub step: u32,
    pub view: usize,
    pub target: Arc<TargetImage>,
    /// Whether its render counts in the statistics window: only the first render of a view does.
    pub counts: bool,
}

impl Trainer<'_> {
    /// The next steps, up to the first after which something reads or changes the model.
    pub(super) fn plan_batch(&mut self) -> Result<Vec<PlannedStep>> {
        let first = self.state.step + 1;
        let mut order = ViewOrder::after(&self.state, self.config.seed, &self.train_views);
        let mut wanted = self.targets.batch_steps(self.views, self.backend.batch_steps());
        if self.config.exposure == Exposure::Affine {
            // Exposures change between epochs.
            wanted = wanted.min(order.left_in_epoch());
        }
        let ends = |step| {
            let TrainConfig { eval_every, save_every, .. } = *self.config;
            self.is_due(eval_every, step)
                || self.is_due(save_every, step)
                || self.schedule.is_density_step(step)
                || self.schedule.is_crop_step(step)
                || self.is_rounding_step(step)
                || self.may_change_length(step)
        };
        let steps = (first..=self.schedule.last_step).take(wanted);
        let len = steps.clone().position(ends).map_or(steps.count(), |at| at + 1);

        let views: Vec<usize> = order.by_ref().take(len).collect();
        // All photos of the next batch will be needed as soon as this one is done.
        let left = (self.schedule.last_step - self.state.step) as usize - len;
        let next: Vec<usize> = order.take(photos_ahead(wanted).min(left)).collect();
        let mut wanted = self.targets.wanted(self.views, &views, self.stage.render_scale);
        wanted.extend(self.targets.wanted(self.views, &next, self.next_scale(first + len as u32 - 1)));
        self.views.prefetch(&wanted);
        let mut counted = self.state.window_views.clone();

        let mut batch = Vec::with_capacity(len);
        for (step, view) in (first..).zip(views) {
            match self.targets.get(self.views, view) {
                Ok(target) => {
                    let counts = !counted.contains(&(view as u32));
                    counted.extend(counts.then_some(view as u32));
                    batch.push(PlannedStep { step, view, target, counts });
                }
                // Do the steps before it first; the next batch requests it again.
                Err(_) if !batch.is_empty() => break,
                Err(error) => return Err(error),
            }
        }
        Ok(batch)
    }

    /// Render scale after a step, unless density control changes the length of the run.
    fn next_scale(&self, step: u32) -> f64 {
        if self.schedule.is_density_step(step) { self.stage_at(step) } else { self.stage }.render_scale
    }

    pub(super) fn request<'t>(&self, planned: &'t PlannedStep) -> StepRequest<'t> {
        let step = planned.step;
        StepRequest {
            step,
            camera: self.targets.camera(self.views, planned.view),
            photo: Some(self.targets.photo(planned.view)),
            target: &planned.target,
            background: background_of(self.config, step),
            sh_degree: self.schedule.sh_degree(step, self.config.sh_degree),
            loss: self.config.loss,
            rates: self.schedule.rates(self.config, step),
            accumulate_statistics: planned.counts,
            exposure: self.state.exposures.of(planned.view),
        }
    }

    /// Counts steps as done, and their views as drawn.
    pub(super) fn advance(&mut self, steps: usize) {
        let mut order = ViewOrder::after(&self.state, self.config.seed, &self.train_views);
        let drawn: Vec<usize> = order.by_ref().take(steps).collect();
        order.store(&mut self.state);
        for view in drawn {
            if !self.state.window_views.contains(&(view as u32)) {
                self.state.window_views.push(view as u32);
            }
        }
        self.state.step += steps as u32;
        if steps > 0 && self.state.epoch_used as usize == self.state.epoch_order.len() {
            self.state.exposures.end_epoch(self.state.step >= self.schedule.density_start);
        }
    }
}
