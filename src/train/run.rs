//! The loop: draws views, steps, revises, evaluates, reports.

use super::config::TrainConfig;
use super::events::{Control, StopReason, TrainEvent};
use super::revise::revise_maps;
use super::schedule::Schedule;
use super::state::{CurvePoint, TrainState};
use crate::backend::{Backend, RenderOptions, RenderedImage, StepRequest};
use crate::clock::process_cpu_secs;
use crate::eval::{Evaluation, ViewQuality, quality_of};
use crate::views::{Split, ViewSource};
use crate::{Error, Result};
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::time::Instant;

/// Consumer of the events.
pub type Sink<'a> = &'a mut dyn FnMut(TrainEvent<'_>) -> Result<Control>;

/// Views decoded ahead.
const PREFETCH_VIEWS: usize = 4;

/// Test views whose pictures are held at once.
const EVAL_BATCH: usize = 4;

/// Trains from `start` (a fresh state or a loaded checkpoint) to the end of `config.steps`, the time
/// limit or the consumer's stop, and returns the final state and why it ended.
///
/// # Errors
/// [`Error::Usage`] if there is nothing to train on; else whatever the backend, the views or the
/// consumer report.
pub fn train(
    config: &TrainConfig,
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    start: TrainState,
    sink: Sink<'_>,
) -> Result<(TrainState, StopReason)> {
    let train_views = views.indices(Split::Train);
    if train_views.is_empty() {
        return Err(Error::Usage("no training view: every view is held out; lower --test-every".into()));
    }
    backend.upload(&start.model, &start.adam)?;
    let schedule = Schedule::new(config, train_views.len());
    let test_views = views.indices(Split::Test);
    let mut run = Run { config, backend, views, train_views, test_views, schedule, state: start };
    run.train(sink)
}

struct Run<'a> {
    config: &'a TrainConfig,
    backend: &'a mut dyn Backend,
    views: &'a dyn ViewSource,
    train_views: Vec<usize>,
    test_views: Vec<usize>,
    schedule: Schedule,
    state: TrainState,
}

/// Training time since a moment.
struct Clock {
    wall: Instant,
    cpu_secs: f64,
}

impl Clock {
    fn start() -> Self {
        Self { wall: Instant::now(), cpu_secs: process_cpu_secs() }
    }
}

impl Run<'_> {
    fn train(&mut self, sink: Sink<'_>) -> Result<(TrainState, StopReason)> {
        sink(TrainEvent::Started {
            device: self.backend.device(),
            step: self.state.step,
            steps: self.config.steps,
            train_views: self.train_views.len(),
            test_views: self.test_views.len(),
        })?;
        let mut reason = StopReason::Steps;
        while self.state.step < self.config.steps {
            let clock = Clock::start();
            let control = self.step(&clock, sink)?;
            let step = self.state.step;
            let out_of_time =
                self.config.max_time_secs.is_some_and(|limit| self.state.history.train_wall_secs >= limit);
            if control == Control::Stop {
                reason = StopReason::Consumer;
                break;
            }
            if out_of_time {
                reason = StopReason::Time;
                break;
            }
            let due = |every: u32| every > 0 && step.is_multiple_of(every) && step < self.config.steps;
            let (eval_due, save_due) = (due(self.config.eval_every), due(self.config.save_every));
            if eval_due {
                self.evaluate(false, sink)?;
            }
            if save_due {
                self.checkpoint(sink)?;
            }
        }
        if reason != StopReason::Consumer {
            self.evaluate(true, sink)?;
        }
        self.checkpoint(sink)?;
        sink(TrainEvent::Finished { reason })?;
        Ok((self.state.clone(), reason))
    }

    /// One step, and the revision that may follow it; the times end up in the history.
    fn step(&mut self, clock: &Clock, sink: Sink<'_>) -> Result<Control> {
        let step = self.state.step + 1;
        let view = self.draw_view();
        let target = self.views.target(view)?;
        let report = self.backend.step(&StepRequest {
            step,
            camera: self.views.camera(view),
            target: &target,
            background: self.config.background,
            sh_degree: self.schedule.sh_degree(step, self.config.sh_degree),
            loss: self.config.loss,
            rates: self.schedule.rates(self.config, step),
            // Nothing reads them while the number of splats and texels is fixed.
            accumulate_statistics: false,
        })?;
        if !report.loss.total.is_finite() {
            return Err(Error::Device(format!(
                "step {step}: the loss is {}; the last checkpoint is intact",
                report.loss.total
            )));
        }
        self.state.step = step;
        let mut wall_end = Instant::now();
        if self.schedule.revises(step, self.config.steps) {
            let (model, _) = self.backend.read_back()?;
            if let Some(plan) = revise_maps(&model, self.config.texture) {
                self.backend.apply_plan(&plan)?;
            }
            wall_end = Instant::now();
        }
        let history = &mut self.state.history;
        history.train_wall_secs += (wall_end - clock.wall).as_secs_f64();
        history.train_cpu_secs += process_cpu_secs() - clock.cpu_secs;
        sink(TrainEvent::Step {
            step,
            view,
            loss: report.loss,
            report: &report,
            num_splats: self.state.model.num_splats(),
            num_texels: self.state.model.num_texels(),
            train_wall_secs: history.train_wall_secs,
            train_cpu_secs: history.train_cpu_secs,
        })
    }

    /// Next view of the epoch; a new epoch is a new permutation that follows from the seed alone.
    fn draw_view(&mut self) -> usize {
        let state = &mut self.state;
        if state.epoch_used as usize >= state.epoch_order.len() {
            let stream = 0x7669_6577_u64 << 32 | u64::from(state.epochs);
            let mut rng =
                Pcg64Mcg::seed_from_u64(self.config.seed ^ stream.wrapping_mul(0x9E37_79B9_7F4A_7C15));
            state.epoch_order = self.train_views.iter().map(|&v| v as u32).collect();
            state.epoch_order.shuffle(&mut rng);
            state.epochs += 1;
            state.epoch_used = 0;
        }
        let at = state.epoch_used as usize;
        let next: Vec<usize> =
            state.epoch_order[at..].iter().skip(1).take(PREFETCH_VIEWS).map(|&v| v as usize).collect();
        self.views.prefetch(&next);
        state.epoch_used += 1;
        state.epoch_order[at] as usize
    }

    fn evaluate(&mut self, last: bool, sink: Sink<'_>) -> Result<()> {
        let step = self.state.step;
        let options = RenderOptions {
            background: self.config.background,
            sh_degree: self.schedule.sh_degree(step.max(1), self.config.sh_degree),
            geometry: false,
        };
        let mut on_view = |view: usize, image: &RenderedImage| -> Result<()> {
            sink(TrainEvent::EvalView { step, view, image })?;
            Ok(())
        };
        let evaluation = evaluate(self.backend, self.views, &self.test_views, &options, &mut on_view)?;
        let history = &self.state.history;
        let point = CurvePoint {
            step,
            wall_secs: history.train_wall_secs,
            cpu_secs: history.train_cpu_secs,
            psnr_test: evaluation.psnr,
            grad_psnr_test: evaluation.grad_psnr,
            primitives: self.state.model.num_splats(),
            texels: self.state.model.num_texels(),
        };
        self.state.history.curve.push(point.clone());
        sink(TrainEvent::Evaluated { step, evaluation: &evaluation, point: &point, last })?;
        Ok(())
    }

    fn checkpoint(&mut self, sink: Sink<'_>) -> Result<()> {
        (self.state.model, self.state.adam) = self.backend.read_back()?;
        sink(TrainEvent::Checkpoint { state: &self.state })?;
        Ok(())
    }
}

/// Renders views and compares them with their photos; `on_view` sees each picture.
///
/// # Errors
/// Whatever the backend, the views or `on_view` report.
pub fn evaluate(
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    indices: &[usize],
    options: &RenderOptions,
    on_view: &mut dyn FnMut(usize, &RenderedImage) -> Result<()>,
) -> Result<Evaluation> {
    let mut per_view: Vec<ViewQuality> = Vec::new();
    for batch in indices.chunks(EVAL_BATCH) {
        views.prefetch(batch);
        let mut images = Vec::new();
        for &view in batch {
            let image = backend.render(&views.camera(view), options)?;
            on_view(view, &image)?;
            images.push((view, image));
        }
        let figures: Result<Vec<ViewQuality>> = images
            .par_iter()
            .map(|(view, image)| Ok(quality_of(views.name(*view), &image.rgb, &*views.target(*view)?)))
            .collect();
        per_view.extend(figures?);
    }
    Ok(Evaluation::from_views(per_view))
}
