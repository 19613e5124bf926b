//! The window of statistics between two density-control steps, and the step itself: reads what the window
//! found, lets [`density`] decide, has the backend carry out the plan.

use super::config::{Policy, TrainConfig};
use super::density::{self, DensityCounts, Life, Revision, Situation};
use super::schedule::Schedule;
use super::state::TrainState;
use super::targets::Targets;
use crate::Result;
use crate::backend::{Backend, DeviceLimits, LossWeights, StepRequest, WindowStatistics};
use crate::camera::Camera;
use crate::frequency::{FrequencySchedule, SplatBudget};
use crate::model::LearningRates;
use crate::views::ViewSource;

/// What the scheduler says from one density-control step to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stage {
    /// Full size of the images over their size in training.
    pub render_scale: f64,
    /// Most texels a side of any map.
    pub texture_cap: u16,
}

impl Stage {
    /// As of a step.
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

/// Who takes part in a density-control step.
pub(super) struct DensityControl<'a> {
    pub config: &'a TrainConfig,
    pub schedule: &'a Schedule,
    pub cameras: &'a [Camera],
    pub stage: Stage,
    /// Bounds what is not bounded by the budget.
    pub limits: DeviceLimits,
}

impl DensityControl<'_> {
    /// Decides and applies the step that is due after `state.step`, and begins a new window. Returns what
    /// was done, and splats and texels after it.
    ///
    /// # Errors
    /// Whatever the backend reports.
    pub fn step(
        &self,
        backend: &mut dyn Backend,
        state: &mut TrainState,
        judge: bool,
    ) -> Result<(DensityCounts, [usize; 2])> {
        let model = backend.read_flushed()?;
        let statistics = backend.read_statistics()?;
        let revision = self.decide(&model, &statistics, state, judge);
        let mut size = [model.num_splats(), model.num_texels()];
        state.lives = revision.lives;
        if let Some(plan) = &revision.plan {
            backend.apply_plan(plan)?;
            size = size_after(&model, plan);
        }
        if judge {
            backend.set_statistics(&WindowStatistics::empty(size[0]))?;
            state.window_views.clear();
        } else {
            // The splats are the same: their window goes on.
            backend.set_statistics(&statistics)?;
        }
        Ok((revision.counts, size))
    }

    fn decide(
        &self,
        model: &crate::model::Model,
        statistics: &WindowStatistics,
        state: &mut TrainState,
        judge: bool,
    ) -> Revision {
        let (config, schedule, step) = (self.config, self.schedule, state.step);
        let components = config.active_components();
        let densify = judge && step <= schedule.densify_until;
        let t = schedule.densify_share(step);
        let n = model.num_splats();
        // The last density-control step before the end of densification may bring all.
        let last = step + schedule.density_interval >= schedule.densify_until;
        let rate = if components.scheduler {
            state.pace.rate(n, if last { 1.0 } else { t }, self.stage.render_scale)
        } else {
            1.0
        };
        let max_added = (rate.min(config.density.split_rate) * n as f64) as usize;
        let situation = Situation {
            model,
            lives: &state.lives,
            statistics,
            cameras: self.cameras,
            render_scale: self.stage.render_scale,
            texture_cap: self.stage.texture_cap,
            densify,
            judge,
            texels_trained: step >= schedule.texture_start + schedule.density_interval,
            may_coarsen: schedule.may_coarsen(step),
            max_added,
            initial_splats: state.pace.initial,
            split_texels: schedule.split_texels(config, step),
            patience: schedule.patience,
            opacity_floor: schedule.opacity_floor(config, step),
            rule: config.policy.map_rule(),
        };
        let revision = match config.policy {
            Policy::Plain => {
                let seed = config.seed ^ u64::from(step).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                // Without a budget the number of splats stays.
                let bounds_splats = config.budget.max_splats.or(config.budget.max_params).is_some();
                let most = bounds_splats.then(|| config.budget.within(&self.limits).most_splats(0));
                density::relocate(&situation, &config.density, most, seed)
            }
            _ => {
                let share = if last { 1.0 } else { t };
                let each = config.policy.first_texels_each();
                let start = [state.pace.initial, each * state.pace.initial];
                // Only what was asked for is used up evenly: the device is a bound, not a budget.
                let paced = config.budget.paced(share, start, [n, model.num_texels()]);
                let budget = paced.within(&self.limits);
                density::decide(&situation, &config.density, &components, &budget)
            }
        };
        if judge {
            state.pace.observe(revision.counts.split);
        }
        revision
    }
}

/// Records and pace for a run that has none yet.
pub(super) fn begin(config: &TrainConfig, state: &mut TrainState) {
    let n = state.model.num_splats();
    if state.lives.len() != n {
        let ceiling = if config.active_components().growth {
            config.density.ceiling_start
        } else {
            density::TEXELS_MAX
        };
        state.lives = vec![Life::first(ceiling); n];
        state.pace = SplatBudget::new(n);
    }
}

/// Splats and texels of a model after a plan.
fn size_after(model: &crate::model::Model, plan: &crate::backend::DensityPlan) -> [usize; 2] {
    use crate::backend::MapChange::{Keep, Regrid, Resample};
    let texels = plan.sources.iter().zip(&plan.maps).map(|(&source, change)| match *change {
        Keep => model.textures.maps[source as usize].num_texels(),
        Resample { rows, cols, .. } | Regrid { rows, cols, .. } => usize::from(rows) * usize::from(cols),
    });
    [plan.sources.len(), texels.sum()]
}

/// The statistics of all training views for the flushed model as it is, at the size of the stage: what a
/// window that sees each view once would find if nothing moved. Renders every view; leaves the backend
/// as it was but for its window, which is this.
///
/// # Errors
/// Whatever the backend or the views report.
pub(super) fn full_statistics(
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    train_views: &[usize],
    targets: &mut Targets,
    background: [f32; 3],
    sh_degree: u32,
) -> Result<WindowStatistics> {
    let (model, adam) = backend.read_back()?;
    backend.set_statistics(&WindowStatistics::empty(model.num_splats()))?;
    for &view in train_views {
        let target = targets.get(views, view)?;
        // Without rates nothing moves but the moments, which are put back.
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
        })?;
    }
    let statistics = backend.read_statistics()?;
    backend.upload(&model, &adam)?;
    backend.set_statistics(&statistics)?;
    Ok(statistics)
}
