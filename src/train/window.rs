//! Makes a density-control step: reads the statistics window, lets [`density`] decide, and has the backend apply the plan.

use super::config::{Exposure, TrainConfig};
use super::density::{self, Bound, DensityCounts, Revision, Situation, SplatHistory, SplitShare, Timing};
use super::exposure::Exposures;
use super::random::RandomStream;
use super::schedule::Schedule;
use super::state::{SizeFigures, TrainState};
use crate::backend::{Backend, DeviceLimits, WindowStatistics};
use crate::camera::Camera;
use crate::frequency::{FrequencySchedule, SplatBudget};
use crate::model::{Model, ModelSize};
use crate::{Error, Result};

/// A resolution stage: what the frequency schedule sets from one density-control step to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stage {
    /// Full image size divided by the size in training.
    pub render_scale: f64,
    /// Largest map side, in texels.
    pub texture_cap: u16,
}

impl Stage {
    /// The stage at a step, of at least a render scale.
    pub fn at(
        config: &TrainConfig,
        schedule: &Schedule,
        frequency: &FrequencySchedule,
        smaller_side_px: u32,
        (step, least_scale): (u32, f64),
    ) -> Self {
        let (t, rules) = (schedule.stage_share(step), config.scheduler.rules.set());
        Self {
            render_scale: frequency.render_scale(t, rules.scale, smaller_side_px).max(least_scale),
            texture_cap: frequency.texture_cap(t, rules.cap),
        }
    }
}

/// Largest share of splats that a density-control step splits without a frequency schedule (DashGaussian; not measured).
const UNSCHEDULED_SPLIT_RATE: f64 = 0.2;

/// What a density-control step depends on besides the state.
pub(super) struct DensityControl<'a> {
    pub config: &'a TrainConfig,
    pub schedule: &'a Schedule,
    pub cameras: &'a [Camera],
    pub stage: Stage,
    /// Bound of the model where the budget has none.
    pub limits: DeviceLimits,
    /// Bytes that a file of a wanted size has for splats.
    pub splat_bytes: Option<f64>,
}

/// What a density-control step did.
pub(super) struct Revised {
    /// In numbers of splats and maps.
    pub counts: DensityCounts,
    /// Size of the model after it.
    pub size: SizeFigures,
    /// What the device has no room for, when that first kept the model from growing, or kept it as it was.
    pub no_room: Option<String>,
}

impl DensityControl<'_> {
    /// Decides and applies the revision due after `state.step`, to a model of the size `now`. With `use_statistics` a new window
    /// begins; without, maps are only fitted. Where the device has no room, the model stays without growth, or as it is.
    ///
    /// # Errors
    /// Whatever the backend reports.
    pub fn step(
        &self,
        backend: &mut dyn Backend,
        state: &mut TrainState,
        now: SizeFigures,
        use_statistics: bool,
    ) -> Result<Revised> {
        let read = backend.read_statistics().and_then(|window| Ok((window, backend.read_flushed()?)));
        let (mut revised, window) = match read {
            Ok((window, model)) => {
                (self.revise(backend, state, (&model, &window), use_statistics)?, Some(window))
            }
            Err(Error::DeviceFull(no_room)) => {
                state.device.end_growth(now, state.step);
                (Revised { counts: DensityCounts::default(), size: now, no_room: Some(no_room.what) }, None)
            }
            Err(error) => return Err(error),
        };
        if use_statistics {
            backend.set_statistics(&WindowStatistics::empty(revised.size.splats))?;
            state.window_views.clear();
            let reached = self.reached(state, now, &revised);
            revised.no_room = revised.no_room.or(reached);
            state.device.forget();
        } else if let Some(window) = window {
            // The splats are the same, so their window continues. Where nothing was read, it goes on by itself.
            go_on_with(backend, &window, &mut state.window_views)?;
        }
        Ok(revised)
    }

    /// What the device has no more room for, the first time that it bounds growth.
    fn reached(&self, state: &mut TrainState, before: SizeFigures, revised: &Revised) -> Option<String> {
        if !self.grows(state) || state.device.ended_step > 0 {
            return None;
        }
        let Revised { counts, size, .. } = revised;
        let scale = self.stage.render_scale;
        let fitting = state.device.fitting_splats(&self.limits, before.splats, scale);
        let what = state.device.reached(&self.limits, *size, fitting, counts, scale)?;
        // Maps may go on growing: their texels are bounded by the device's limits.
        state.device.budget.max_splats = Some(size.splats);
        state.device.ended_step = state.step;
        Some(what)
    }

    /// Decides and applies a revision; where it does not fit, one without growth, and else none.
    fn revise(
        &self,
        backend: &mut dyn Backend,
        state: &mut TrainState,
        (model, statistics): (&Model, &WindowStatistics),
        use_statistics: bool,
    ) -> Result<Revised> {
        let (now, pace) = (SizeFigures::from(model.size()), state.pace);
        let mut no_room = None;
        loop {
            let revision = self.decide(model, statistics, state, use_statistics);
            let size = revision.plan.as_ref().map_or(now, |plan| plan.size_after(model).into());
            match revision.plan.as_ref().map_or(Ok(()), |plan| backend.apply_plan(plan)) {
                Ok(()) => {
                    state.histories = revision.histories;
                    return Ok(Revised { counts: revision.counts, size, no_room });
                }
                Err(Error::DeviceFull(full)) => {
                    state.pace = pace;
                    state.device.end_growth(now, state.step);
                    if no_room.replace(full.what).is_some() {
                        return Ok(Revised { counts: DensityCounts::default(), size: now, no_room });
                    }
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// Whether splats and maps may grow after a step.
    fn grows(&self, state: &TrainState) -> bool {
        state.step <= self.schedule.densify_until && !state.growth.has_ended()
    }

    fn decide(
        &self,
        model: &Model,
        statistics: &WindowStatistics,
        state: &mut TrainState,
        use_statistics: bool,
    ) -> Revision {
        let (config, schedule, step) = (self.config, self.schedule, state.step);
        let (components, spec) = (config.active_components(), config.policy.spec());
        let (n, t) = (model.num_splats(), schedule.densify_share(step));
        // The last step of densification may spend the whole budget.
        let is_last = step + schedule.density_interval >= schedule.densify_until;
        let share = if is_last { 1.0 } else { t };
        let rule = config.rule();
        let split_share = match rule.split_share {
            SplitShare::Fixed(share) => share,
            SplitShare::Scheduled if !components.scheduler => UNSCHEDULED_SPLIT_RATE,
            SplitShare::Scheduled => state.pace.rate(n, share, self.stage.render_scale),
        };
        let max_splits = (split_share * n as f64) as usize;
        let timing = Timing {
            grows: use_statistics && self.grows(state),
            use_statistics,
            texels_trained: step >= schedule.texture_start + schedule.density_interval,
            may_coarsen: schedule.may_coarsen(step),
            may_pad: !schedule.has_pruned(step),
            sh_tested: schedule.sh_tested(step, config.sh_degree),
            sh_trial_checks: schedule.sh_trial_checks(),
            sh_highest: config.sh_degree,
            max_splits,
            split_texels: (!rule.splits_any_length).then(|| schedule.split_texels(config, step)),
            patience: schedule.patience,
            opacity_floor: schedule.opacity_floor(config, step),
        };
        let Bound { mut budget, charge, most_charge } = schedule.bound(config, step, self.splat_bytes);
        if rule.is_paced {
            let each = config.policy.first_texels_each();
            let bare = ModelSize::uniform(state.pace.initial, each, 0);
            let degree = config.first_sh_degree(bare, &schedule.bound(config, 0, self.splat_bytes));
            let start = ModelSize::uniform(state.pace.initial, each, degree);
            // Only the user's budget is spent evenly over time: the device is a bound, not a budget.
            budget = budget.paced(share, &start, &model.size());
        }
        let situation = Situation {
            model,
            histories: &state.histories,
            statistics,
            cameras: self.cameras,
            settings: &config.density,
            components,
            map_rule: spec.map_rule,
            render_scale: self.stage.render_scale,
            texture_cap: self.stage.texture_cap,
            timing,
            charge,
            budget: state.device.within(&budget, &self.limits, n, self.stage.render_scale),
            most_charge,
            initial_splats: state.pace.initial,
            seed: RandomStream::Growth.seed(config.seed, step),
        };
        let revision = density::revise(config.policy, &situation);
        if use_statistics {
            state.pace.observe(revision.counts.split);
        }
        revision
    }
}

/// Goes on with a statistics window of the same splats, or begins another if the device has no room for it.
pub(super) fn go_on_with(
    backend: &mut dyn Backend,
    window: &WindowStatistics,
    views: &mut Vec<u32>,
) -> Result<()> {
    match backend.set_statistics(window) {
        Err(Error::DeviceFull(_)) => {
            views.clear();
            backend.set_statistics(&WindowStatistics::empty(window.seen.len()))
        }
        outcome => outcome,
    }
}

/// Gives a run that has not begun the histories of its splats and its target number of splats.
pub(super) fn begin(config: &TrainConfig, num_views: usize, state: &mut TrainState) {
    let n = state.model.num_splats();
    if state.histories.len() != n {
        let ceiling = config.policy.first_ceiling(config.active_components().growth);
        state.histories = vec![SplatHistory::first(ceiling); n];
        state.pace = SplatBudget::new(n);
    }
    state.view_losses.resize(num_views, 0.0);
    if config.exposure == Exposure::Affine && state.exposures.maps.is_empty() {
        state.exposures = Exposures::new(num_views);
    }
}
