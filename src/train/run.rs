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
use crate::{Error, Result, Warning};
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
        let reason = match self.steps(sink) {
            Ok(reason) => reason,
            Err(error) => {
                // A photo that cannot be read must not cost the work so far; the first error is told.
                let _ = self.checkpoint(sink);
                return Err(error);
            }
        };
        // Saved before the evaluation reads photos, and again with its figures.
        self.checkpoint(sink)?;
        if reason != StopReason::Consumer && self.evaluate(true, sink)? == Control::Continue {
            self.checkpoint(sink)?;
        }
        sink(TrainEvent::Finished { reason })?;
        Ok((self.state.clone(), reason))
    }

    fn steps(&mut self, sink: Sink<'_>) -> Result<StopReason> {
        // An interruption may have come between a step and the evaluation that was due.
        if self.is_due(self.config.eval_every) && self.evaluated_at() != Some(self.state.step) {
            self.evaluate(false, sink)?;
        }
        while self.state.step < self.config.steps {
            let clock = Clock::start();
            let mut control = self.step(&clock, sink)?;
            let limit = self.config.max_time_secs;
            if control == Control::Continue && limit.is_some_and(|l| self.state.history.train_wall_secs >= l)
            {
                return Ok(StopReason::Time);
            }
            if control == Control::Continue && self.is_due(self.config.eval_every) {
                control = self.evaluate(false, sink)?;
            }
            if control == Control::Continue && self.is_due(self.config.save_every) {
                self.checkpoint(sink)?;
            }
            if control == Control::Stop {
                return Ok(StopReason::Consumer);
            }
        }
        Ok(StopReason::Steps)
    }

    /// Whether something that happens each `every` steps is due now; the end has its own.
    fn is_due(&self, every: u32) -> bool {
        let step = self.state.step;
        every > 0 && step > 0 && step.is_multiple_of(every) && step < self.config.steps
    }

    fn evaluated_at(&self) -> Option<u32> {
        self.state.history.curve.last().map(|p| p.step)
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
                "step {step}: the loss is {}: lower the learning rates, or report this with the capture",
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

    fn evaluate(&mut self, last: bool, sink: Sink<'_>) -> Result<Control> {
        let step = self.state.step;
        let options = RenderOptions {
            background: self.config.background,
            sh_degree: self.schedule.sh_degree(step.max(1), self.config.sh_degree),
            geometry: false,
        };
        let mut on_view =
            |view: usize, image: &RenderedImage| sink(TrainEvent::EvalView { step, view, image });
        let outcome = evaluate(self.backend, self.views, &self.test_views, &options, &mut on_view)?;
        let evaluation = match outcome {
            Evaluated::Figures(evaluation) => evaluation,
            Evaluated::Stopped => return Ok(Control::Stop),
            Evaluated::Nothing => {
                let message = "no held-out view has a pixel that counts: there are no test figures";
                return sink(TrainEvent::Warning(Warning {
                    code: "no-test-figures".into(),
                    message: message.into(),
                    count: 1,
                }));
            }
        };
        let history = &mut self.state.history;
        let point = CurvePoint {
            step,
            wall_secs: history.train_wall_secs,
            cpu_secs: history.train_cpu_secs,
            psnr_test: evaluation.psnr,
            grad_psnr_test: evaluation.grad_psnr,
            primitives: self.state.model.num_splats(),
            texels: self.state.model.num_texels(),
        };
        history.curve.retain(|p| p.step != step);
        history.curve.push(point.clone());
        sink(TrainEvent::Evaluated { step, evaluation: &evaluation, point: &point, last })
    }

    fn checkpoint(&mut self, sink: Sink<'_>) -> Result<()> {
        (self.state.model, self.state.adam) = self.backend.read_back()?;
        sink(TrainEvent::Checkpoint { state: &self.state })?;
        Ok(())
    }
}

/// Outcome of [`evaluate`].
pub enum Evaluated {
    /// Figures of the views that have pixels to compare.
    Figures(Evaluation),
    /// There are none.
    Nothing,
    /// The consumer stopped it.
    Stopped,
}

/// Renders views and compares them with their photos; `on_view` sees each picture. Views of which the
/// mask leaves nothing are rendered but have no figures.
///
/// # Errors
/// Whatever the backend, the views or `on_view` report.
pub fn evaluate(
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    indices: &[usize],
    options: &RenderOptions,
    on_view: &mut dyn FnMut(usize, &RenderedImage) -> Result<Control>,
) -> Result<Evaluated> {
    let mut per_view: Vec<ViewQuality> = Vec::new();
    for batch in indices.chunks(EVAL_BATCH) {
        views.prefetch(batch);
        let mut images = Vec::new();
        for &view in batch {
            let image = backend.render(&views.camera(view), options)?;
            if on_view(view, &image)? == Control::Stop {
                return Ok(Evaluated::Stopped);
            }
            images.push((view, image));
        }
        let figures = images.par_iter().map(|(view, image)| {
            let target = views.target(*view)?;
            let quality = || quality_of(views.name(*view), &image.rgb, &target);
            Ok(target.has_pixels_that_count().then(quality))
        });
        per_view.extend(figures.collect::<Result<Vec<_>>>()?.into_iter().flatten());
    }
    Ok(Evaluation::from_views(per_view).map_or(Evaluated::Nothing, Evaluated::Figures))
}
