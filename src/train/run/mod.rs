//! The training loop: draws views, steps, applies density control, evaluates and emits events.

mod batch;
mod length;
mod no_room;
mod reading;
mod rounding;
mod trainer;

use batch::PlannedStep;
pub use batch::photos_ahead;
pub use reading::NO_SNAPSHOT;
use trainer::{Clock, Trainer, smaller_side_px};

use super::config::TrainConfig;
use super::density::DensityCounts;
use super::eta::{Course, Eta};
use super::events::{Control, Sink, StopReason, TrainEvent};
use super::expected_size::ExpectedSize;
use super::limits::check_limits;
use super::pacing::Timing;
use super::prune::{Pruned, Round, TrainingViews};
use super::schedule::{MOST_PROBES, Schedule};
use super::state::{SizeFigures, TrainState};
use super::targets::Targets;
use super::window::{self, DensityControl, Stage};
use crate::backend::{Backend, StepReport, WindowStatistics};
use crate::camera::Camera;
use crate::clock::process_cpu_secs;
use crate::frequency::FrequencySchedule;
use crate::rounding::Rounder;
use crate::views::{Split, ViewSource, by_place};
use crate::{Error, Result};
use std::time::Instant;

/// Trains from `start` (a fresh state or a loaded checkpoint) to the end of the steps or the consumer's stop. Returns the
/// final state and why the run ended.
///
/// # Errors
/// [`Error::Usage`] if there is no training view, [`Error::Device`] if the device cannot hold the run (see
/// [`check_limits`]); otherwise whatever the backend, the views or the consumer report.
pub fn train(
    config: &TrainConfig,
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    start: TrainState,
    sink: Sink<'_>,
) -> Result<(TrainState, StopReason)> {
    let began = Instant::now();
    let now = || began.elapsed().as_secs_f64();
    train_by(&Timing::by_steps(&now), config, backend, None, views, start, sink)
}

/// [`train`] by a clock, with what rounds the model if its file has a wanted size. With a deadline, the length of the run follows
/// from the time: each decision is reported by [`TrainEvent::Planned`]. A run whose settings hold these decisions repeats them without a clock.
///
/// # Errors
/// As [`train`].
pub fn train_by<'a>(
    timing: &'a Timing<'a>,
    config: &'a TrainConfig,
    backend: &'a mut dyn Backend,
    rounder: Option<&'a mut dyn Rounder>,
    views: &'a dyn ViewSource,
    mut start: TrainState,
    sink: Sink<'_>,
) -> Result<(TrainState, StopReason)> {
    let train_views = by_place(views, views.indices(Split::Train));
    if train_views.is_empty() {
        return Err(Error::Usage("no training view: every view is held out; lower --test-every".into()));
    }
    let clock = Clock::start(timing);
    window::begin(config, views.num_views(), &mut start);
    let limits = check_limits(config, backend, views, &start.model)?;
    backend.forget_photos();
    backend.upload(&start.model, &start.adam)?;
    if !start.window.seen.is_empty() {
        backend.set_statistics(&start.window)?;
    }
    // A change due after the step that was done last follows its density-control step.
    let schedule = Schedule::of_run(config, train_views.len(), start.step.saturating_sub(1));
    let test_views = views.indices(Split::Test);
    let before_analysis = clock.wall_secs();
    let frequency = match config.active_components().scheduler {
        true => FrequencySchedule::analyse(views, &config.scheduler)?,
        false => FrequencySchedule::flat(),
    };
    start.history.analysis_wall_secs += clock.wall_secs() - before_analysis;
    let cameras: Vec<Camera> = train_views.iter().map(|&view| views.camera(view)).collect();
    let smaller_side_px = smaller_side_px(&cameras);
    let stage = Stage::at(
        config,
        &schedule,
        &frequency,
        smaller_side_px,
        (start.stage_step, start.device.least_scale),
    );
    let pixels = cameras.iter().map(|camera| camera.pinhole.num_pixels() as f64).sum::<f64>();
    let pixels = pixels / cameras.len() as f64;
    let initial = if start.step == 0 { start.model.num_splats() } else { start.pace.initial };
    let eta = Eta::new(Course {
        costs: timing.costs,
        size: ExpectedSize::new(config, &Schedule::new(config, train_views.len()), initial, pixels),
        pixels,
        probes: cameras.len().min(MOST_PROBES) as f64,
        end_secs: timing.end_secs,
    });
    let size = start.model.size().into();
    let targets = Targets::new(views.num_views(), 1.0);
    let mut trainer = Trainer {
        timing,
        plan: config.plan.clone(),
        config,
        backend,
        rounder,
        views,
        train_views,
        test_views,
        schedule,
        frequency,
        cameras,
        limits,
        eta,
        stage,
        targets,
        size,
        state: start,
        saved_secs: clock.began_secs,
        warnings: Vec::new(),
    };
    trainer.begin_stage(trainer.state.stage_step);
    // The analysis of the photos is part of the training time.
    trainer.state.history.train_wall_secs += clock.wall_secs();
    trainer.state.history.train_cpu_secs += process_cpu_secs() - clock.cpu_secs;
    trainer.train(sink)
}

impl Trainer<'_> {
    fn train(&mut self, sink: Sink<'_>) -> Result<(TrainState, StopReason)> {
        sink(TrainEvent::Started {
            device: self.backend.device(),
            step: self.state.step,
            steps: self.last_step(),
            train_views: self.train_views.len(),
            test_views: self.test_views.len(),
        })?;
        let reason = match self.steps(sink) {
            Ok(reason) => reason,
            Err(error) => {
                // An unreadable photo must not cost the work so far. Only the first error is reported.
                let _ = self.last_checkpoint(sink);
                return Err(error);
            }
        };
        // Saved before the evaluation, which may fail to read photos, and again with its figures.
        self.last_checkpoint(sink)?;
        if reason != StopReason::Consumer && self.evaluate(true, sink)? != Control::Stop {
            self.save(false, sink)?;
        }
        sink(TrainEvent::Finished { reason })?;
        Ok((self.state.clone(), reason))
    }

    fn steps(&mut self, sink: Sink<'_>) -> Result<StopReason> {
        // The run may have been interrupted between a step and the evaluation due after it,
        if self.is_due(self.config.eval_every, self.state.step)
            && self.evaluated_at() != Some(self.state.step)
        {
            self.evaluate(false, sink)?;
        }
        // or have failed between a step and the density-control step due after it.
        let step = self.state.step;
        if step > 0 && self.state.revised_step != step {
            self.revise()?;
            self.warn(sink)?;
        }
        let is_in_phase = self.schedule.rounding.is_some_and(|phase| self.state.step >= phase.start);
        if self.rounder.is_none() || !is_in_phase {
            self.unround()?;
        }
        // The run may have been interrupted before it was rounded.
        self.round()?;
        self.follow_plan(sink)?;
        while self.state.step < self.schedule.last_step {
            let mut control = self.batch(sink)?;
            if control == Control::Snapshot {
                control = self.snapshot(sink)?;
            }
            if control != Control::Stop && self.is_due(self.config.eval_every, self.state.step) {
                control = self.evaluate(false, sink)?;
            }
            if control != Control::Stop && self.is_due(self.config.save_every, self.state.step) {
                control = self.checkpoint(false, sink)?;
            }
            if control != Control::Stop && self.is_interim_due() {
                control = self.checkpoint(true, sink)?;
            }
            if control == Control::Stop {
                return Ok(StopReason::Consumer);
            }
        }
        Ok(StopReason::Steps)
    }

    /// Whether something done every `every` steps is due after `step`. The last step is handled separately.
    fn is_due(&self, every: u32, step: u32) -> bool {
        every > 0 && step > 0 && step.is_multiple_of(every) && step < self.last_step()
    }

    /// Whether a crash would now cost more than the settings allow.
    fn is_interim_due(&self) -> bool {
        let TrainConfig { save_every, save_secs, .. } = *self.config;
        let since_secs = (self.timing.now)() - self.saved_secs;
        save_every == 0
            && save_secs > 0
            && since_secs >= f64::from(save_secs)
            && self.state.step < self.schedule.last_step
    }

    fn evaluated_at(&self) -> Option<u32> {
        self.state.history.curve.last().map(|p| p.step)
    }

    /// Does the steps that go to the backend at once and the density-control step that may follow them, and
    /// adds their time to the history.
    fn batch(&mut self, sink: Sink<'_>) -> Result<Control> {
        let clock = Clock::start(self.timing);
        let share_before = self.schedule.share(self.state.step);
        let (batch, reports) = self.fitting_batch()?;
        for (planned, report) in batch.iter().zip(&reports) {
            self.state.exposures.record(planned.view, report.colour_sums);
            self.state.view_losses[planned.view] = report.loss.total as f32;
            self.state.device.observe(&report.counters);
        }
        self.advance(batch.len());
        let diverged = reports.iter().position(|report| !report.loss.total.is_finite());
        let (steps_secs, size) = (clock.wall_secs(), self.size);
        let share = self.schedule.share(self.state.step) - share_before;
        self.eta.observe_steps(batch.len() as u32, share, steps_secs, (self.stage.render_scale, size.splats));
        let pruning_before = self.state.history.prune_wall_secs;
        let changed = if diverged.is_none() { self.revise()? } else { None };
        let density_control_secs = clock.wall_secs() - steps_secs;
        if changed.is_some() {
            let pruning_secs = self.state.history.prune_wall_secs - pruning_before;
            self.eta.observe_density(density_control_secs - pruning_secs, size.splats);
            if self.schedule.rounds_left(self.state.step) > 0 {
                self.eta.observe_round(pruning_secs, size.splats);
            }
        }
        self.state.history.density_control_wall_secs += density_control_secs;
        if diverged.is_none() {
            self.round()?;
        }
        let wall_secs = clock.wall_secs();
        let times = [wall_secs, process_cpu_secs() - clock.cpu_secs];
        let finite_steps = diverged.unwrap_or(batch.len());
        let mut control = self.report((&batch, &reports[..finite_steps]), size, times, sink)?;
        control = control.max(self.warn(sink)?);
        if let Some((counts, pruned)) = changed {
            let (size, step, Stage { render_scale, texture_cap }) = (self.size, self.state.step, self.stage);
            let event = TrainEvent::DensityControl {
                step,
                counts,
                size,
                render_scale,
                texture_cap,
                wall_secs: density_control_secs,
            };
            control = control.max(sink(event)?);
            if let Some(pruned) = pruned {
                control = control.max(sink(TrainEvent::Pruned(pruned))?);
            }
        }
        match diverged {
            None => Ok(control.max(self.follow_plan(sink)?)),
            Some(at) => Err(Error::Device(format!(
                "step {}: the loss is {}: lower the learning rates, or report this with the capture",
                batch[at].step, reports[at].loss.total
            ))),
        }
    }

    /// Makes the density-control step or the crop step that is due, if any; returns what the former did, and what a round
    /// of pruning after it did.
    fn revise(&mut self) -> Result<Option<(DensityCounts, Option<Pruned>)>> {
        let step = self.state.step;
        let due = self.schedule.is_density_step(step);
        if !due && !self.schedule.is_crop_step(step) {
            return Ok(None);
        }
        self.unround()?;
        let use_statistics = due && step >= self.schedule.density_start;
        if use_statistics {
            self.observe_growth();
        }
        let density = DensityControl {
            config: self.config,
            schedule: &self.schedule,
            cameras: &self.cameras,
            stage: self.stage,
            limits: self.limits,
            splat_bytes: self.rounder.as_ref().map(|rounder| rounder.splat_bytes()),
        };
        let revised = density.step(self.backend, &mut self.state, self.size, use_statistics)?;
        self.size = revised.size;
        if let Some(what) = revised.no_room {
            self.growth_ended(&what);
        }
        if due {
            self.begin_stage(step);
        }
        // A round of pruning that fails is not repeated on resume.
        self.state.revised_step = step;
        let pruned = self.prune()?;
        Ok(due.then_some((revised.counts, pruned)))
    }

    /// With growth by need: compares the loss of all training views with that before, at full image size.
    fn observe_growth(&mut self) {
        let losses: Vec<f64> =
            self.train_views.iter().map(|&view| f64::from(self.state.view_losses[view])).collect();
        let need_db = self.config.density.need_db;
        if need_db > 0.0 && self.stage.render_scale == 1.0 && losses.iter().all(|&loss| loss > 0.0) {
            let mean = losses.iter().sum::<f64>() / losses.len() as f64;
            self.state.growth.observe(mean, self.size.params, need_db, self.state.step);
        }
    }

    /// Does the round of pruning that is due, if any.
    fn prune(&mut self) -> Result<Option<Pruned>> {
        let (config, step) = (self.config, self.state.step);
        if self.schedule.rounds_left(step) == 0 {
            return Ok(None);
        }
        let mut training = TrainingViews {
            views: self.views,
            train_views: &self.train_views,
            targets: &mut self.targets,
            exposures: &self.state.exposures,
        };
        let clock = Clock::start(self.timing);
        let mut round = Round::of(config, &self.schedule, step);
        round.max_bytes = self.rounder.as_ref().map(|rounder| rounder.splat_bytes());
        let pruned = match round.run(self.backend, &mut training, &mut self.state.histories) {
            // Rounds to come make up for it; a run that ends above its budget says so.
            Err(Error::DeviceFull(no_room)) => {
                self.not_pruned(&no_room.what);
                None
            }
            outcome => outcome?,
        };
        if let Some(pruned) = &pruned {
            let splats = self.state.histories.len();
            self.size = SizeFigures { splats, texels: pruned.texels, params: pruned.params };
        }
        self.backend.set_statistics(&WindowStatistics::empty(self.size.splats))?;
        self.state.history.pruned.extend(pruned);
        self.state.history.prune_wall_secs += clock.wall_secs();
        Ok(pruned)
    }

    /// Sets render scale and texture cap to those of a step.
    fn begin_stage(&mut self, step: u32) {
        let stage = self.stage_at(step);
        if stage.render_scale != self.stage.render_scale {
            // Losses of images of another size cannot be compared.
            self.state.view_losses.fill(0.0);
        }
        self.stage = stage;
        self.targets.set_scale(self.stage.render_scale);
        self.state.stage_step = step;
    }

    pub(super) fn stage_at(&self, step: u32) -> Stage {
        let smaller_side_px = smaller_side_px(&self.cameras);
        let at = (step, self.state.device.least_scale);
        Stage::at(self.config, &self.schedule, &self.frequency, smaller_side_px, at)
    }

    /// Reports the steps of a batch, each with an even share of its `[wall, cpu]` seconds. The backend has done
    /// all of them, so all are reported even if the consumer answers stop.
    fn report(
        &mut self,
        (batch, reports): (&[PlannedStep], &[StepReport]),
        size: SizeFigures,
        [wall_secs, cpu_secs]: [f64; 2],
        sink: Sink<'_>,
    ) -> Result<Control> {
        let remaining_secs = self.eta_secs();
        let history = &mut self.state.history;
        let (wall_before, cpu_before) = (history.train_wall_secs, history.train_cpu_secs);
        history.train_wall_secs += wall_secs;
        history.train_cpu_secs += cpu_secs;
        let mut control = Control::Continue;
        for (at, (planned, report)) in batch.iter().zip(reports).enumerate() {
            // Exactly 1 at the last step, so that its times equal those of the history.
            let share = (at + 1) as f64 / batch.len() as f64;
            let answer = sink(TrainEvent::Step {
                step: planned.step,
                view: planned.view,
                loss: report.loss,
                report,
                size,
                train_wall_secs: wall_before + wall_secs * share,
                train_cpu_secs: cpu_before + cpu_secs * share,
                remaining_secs: remaining_secs + wall_secs * (1.0 - share),
            })?;
            control = control.max(answer);
        }
        Ok(control)
    }
}
