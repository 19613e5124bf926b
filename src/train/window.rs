//! Makes a density-control step: reads the statistics window, lets [`density`] decide, and has the backend apply the plan.

use super::config::{Exposure, TrainConfig};
use super::density::{self, DensityCounts, Revision, Situation, SplatHistory};
use super::exposure::Exposures;
use super::policy::DensityStep;
use super::schedule::Schedule;
use super::state::TrainState;
use super::targets::Targets;
use crate::Result;
use crate::backend::{Backend, DeviceLimits, LossWeights, StepRequest, WindowStatistics};
use crate::camera::Camera;
use crate::frequency::{FrequencySchedule, SplatBudget};
use crate::model::{LearningRates, ModelSize};
use crate::views::ViewSource;

/// A resolution stage: what the frequency schedule sets from one density-control step to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stage {
    /// Full image size divided by the size in training.
    pub render_scale: f64,
    /// Largest map side, in texels.
    pub texture_cap: u16,
}

impl Stage {
    /// The stage at a step.
    pub fn at(
        config: &TrainConfig,
        schedule: &Schedule,
        frequency: &FrequencySchedule,
        smaller_side_px: u32,
        step: u32,
    ) -> Self {
        let t = schedule.stage_share(step);
        Self {
            render_scale: frequency.render_scale(t, config.scheduler.scale_rule, smaller_side_px),
            texture_cap: frequency.texture_cap(t, config.scheduler.cap_rule),
        }
    }
}

/// What a density-control step depends on besides the state.
pub(super) struct DensityControl<'a> {
    pub config: &'a TrainConfig,
    pub schedule: &'a Schedule,
    pub cameras: &'a [Camera],
    pub stage: Stage,
    /// The stage of the window before.
    pub last_stage: Stage,
    /// Bound of the model where the budget has none.
    pub limits: DeviceLimits,
}

impl DensityControl<'_> {
    /// Decides and applies the revision due after `state.step`. Returns what it did, and splats and texels
    /// after it. With `use_statistics` a new window begins; without, maps are only fitted.
    ///
    /// # Errors
    /// Whatever the backend reports.
    pub fn step(
        &self,
        backend: &mut dyn Backend,
        state: &mut TrainState,
        use_statistics: bool,
    ) -> Result<(DensityCounts, ModelSize)> {
        let model = backend.read_flushed()?;
        let statistics = backend.read_statistics()?;
        let revision = self.decide(&model, &statistics, state, use_statistics);
        let mut size = model.size();
        state.histories = revision.histories;
        state.growth = revision.growth;
        if let Some(plan) = &revision.plan {
            backend.apply_plan(plan)?;
            size = plan.size_after(&model);
        }
        if use_statistics {
            backend.set_statistics(&WindowStatistics::empty(size.splats))?;
            state.window_views.clear();
        } else {
            // The splats are the same, so their window continues.
            backend.set_statistics(&statistics)?;
        }
        Ok((revision.counts, size))
    }

    fn decide(
        &self,
        model: &crate::model::Model,
        statistics: &WindowStatistics,
        state: &mut TrainState,
        use_statistics: bool,
    ) -> Revision {
        let (config, schedule, step) = (self.config, self.schedule, state.step);
        let components = config.active_components();
        let densify = use_statistics && step <= schedule.densify_until;
        let t = schedule.densify_share(step);
        let n = model.num_splats();
        // The last step of densification may spend the whole budget.
        let last = step + schedule.density_interval >= schedule.densify_until;
        let rate = if components.scheduler {
            state.pace.rate(n, if last { 1.0 } else { t }, self.stage.render_scale)
        } else {
            1.0
        };
        let max_added = (rate.min(config.density.split_rate) * n as f64) as usize;
        let policy = config.policy.spec();
        let draws_growth = config.draws_growth();
        // Where splats of any length are split, only those that show nothing fade, as in `plain`.
        let opacity_floor =
            if draws_growth { config.density.relocate_below } else { schedule.opacity_floor(config, step) };
        let situation = Situation {
            model,
            histories: &state.histories,
            statistics,
            cameras: self.cameras,
            render_scale: self.stage.render_scale,
            texture_cap: self.stage.texture_cap,
            images_resized: self.stage.render_scale != self.last_stage.render_scale,
            densify,
            use_statistics,
            texels_trained: step >= schedule.texture_start + schedule.density_interval,
            may_coarsen: schedule.may_coarsen(step),
            may_pad: !schedule.has_given_back(step),
            sh_tested: schedule.sh_tested(step, config.sh_degree),
            sh_trial_checks: schedule.sh_trial.div_ceil(schedule.density_interval.max(1)).min(u16::MAX.into())
                as u16,
            sh_highest: config.sh_degree,
            growth: state.growth,
            step,
            seed: config.seed ^ u64::from(step).wrapping_mul(0x9E37_79B9_7F4A_7C15),
            draws_growth,
            max_added,
            initial_splats: state.pace.initial,
            split_texels: schedule.split_texels(config, step),
            patience: schedule.patience,
            opacity_floor,
            rule: policy.map_rule,
        };
        let revision = match policy.step {
            DensityStep::Relocate => {
                // Without a budget the number of splats stays the same.
                let bounds_splats = config.budget.max_splats.or(config.budget.max_params).is_some();
                let budget = bounds_splats.then(|| schedule.budget(config, step).within(&self.limits));
                density::relocate(&situation, &config.density, budget.as_ref())
            }
            DensityStep::Decide => {
                let share = if last { 1.0 } else { t };
                let each = config.policy.first_texels_each();
                let bare = ModelSize::uniform(state.pace.initial, each, 0);
                let start = ModelSize::uniform(
                    state.pace.initial,
                    each,
                    config.first_sh_degree(bare, &schedule.budget(config, 0)),
                );
                // Only the user's budget is spent evenly over time: the device is a bound, not a budget.
                let paced = schedule.budget(config, step).paced(share, &start, &model.size());
                let budget = paced.within(&self.limits);
                density::decide(&situation, &config.density, &components, &budget)
            }
        };
        if use_statistics {
            state.pace.observe(revision.counts.split);
        }
        revision
    }
}

/// Gives a run that has not begun the histories of its splats and its target number of splats.
pub(super) fn begin(config: &TrainConfig, num_views: usize, state: &mut TrainState) {
    let n = state.model.num_splats();
    if state.histories.len() != n {
        let ceiling = if config.active_components().growth {
            config.density.ceiling_start
        } else {
            density::TEXELS_MAX
        };
        state.histories = vec![SplatHistory::first(ceiling); n];
        state.pace = SplatBudget::new(n);
    }
    if config.exposure == Exposure::Affine && state.exposures.maps.is_empty() {
        state.exposures = Exposures::new(num_views);
    }
}

/// The statistics of all training views for the flushed model, at the image size of the stage: those of a
/// window that sees each view once while nothing moves. Renders every view. Leaves these statistics as the
/// backend's window and its state otherwise unchanged.
///
/// # Errors
/// Whatever the backend or the views report.
pub(super) fn full_statistics(
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    train_views: &[usize],
    targets: &mut Targets,
    (background, sh_degree, exposures): ([f32; 3], u32, &Exposures),
) -> Result<WindowStatistics> {
    let (model, adam) = backend.read_back()?;
    backend.set_statistics(&WindowStatistics::empty(model.num_splats()))?;
    for &view in train_views {
        let target = targets.get(views, view)?;
        // With all rates zero only the moments change, and they are restored below.
        backend.step(&StepRequest {
            step: adam.step + 1,
            camera: targets.camera(views, view),
            photo: targets.photo(view),
            target: &target,
            background,
            sh_degree,
            loss: LossWeights::default(),
            rates: LearningRates::default(),
            accumulate_statistics: true,
            exposure: exposures.of(view),
        })?;
    }
    let statistics = backend.read_statistics()?;
    backend.upload(&model, &adam)?;
    backend.set_statistics(&statistics)?;
    Ok(statistics)
}
