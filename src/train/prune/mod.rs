//! Pruning after growth: takes from a model the splats, SH bands and texels whose loss costs less squared error than a threshold
//! per parameter (method 6.15).

mod accept;
mod costs;
mod cut;
mod error;
mod merge;
mod offers;
mod probe;
#[cfg(test)]
mod tests;

use super::config::TrainConfig;
use super::density::{MapRule, SplatHistory};
use super::exposure::Exposures;
use super::random::RandomStream;
use super::schedule::Schedule;
use super::targets::Targets;
use crate::Result;
use crate::backend::{Backend, ColourMap, TargetImage};
use crate::camera::Camera;
use crate::model::{AdamState, Model};
use crate::views::ViewSource;
use accept::threshold_for;
use costs::SplatCosts;
use error::mean_squared_error;
use merge::{Limits, TRIALS, Trial};
use offers::Offers;
use probe::{ProbeView, probe, probed};
use rand::seq::SliceRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The share of the parameters that [`Round::prune_db`] is asked of.
const THRESHOLD_SHARE: f64 = 0.1;

/// Views on which predictions are checked.
const CHECKED_VIEWS: usize = 8;

/// Views that a round probes, at most. A splat that only other views see would look idle.
pub const MOST_PROBES: usize = 64;

/// Width and height of a probe over those of the view. Half of the pixels along each axis lose nothing: +0.06 dB PSNR, -0.01 dB
/// gradient-PSNR on the mean of four captures (240 pixels, 600 steps, 150,000 parameters: `lab/results/growth-search.jsonl`).
const PROBE_SCALE: f64 = 0.5;

/// Threshold, squared error per parameter, that is beyond anything on offer.
const MOST_THRESHOLD: f64 = 1.0;

/// Share of the splats that a round may remove: of two that hide the same, one looks as idle as the other.
const REMOVABLE: f64 = 0.5;

/// The share of what a model may lose before it is no longer good enough that is for offers; merges may use up the rest.
const CUT_SLACK: f64 = 0.5;

/// Factors by which thresholds may be raised, the highest first, while the model is better than good enough.
const RAISES: [f64; 6] = [1024.0, 256.0, 64.0, 16.0, 4.0, 1.0];

/// All trials of merges together take one in this many steps of a run; least and most steps of one training.
const STEPS_PER_TRIAL_STEP: u32 = 50;
const TRIAL_STEPS: [u32; 2] = [8, 64];

/// A round of pruning.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// What the loss of the last 10 % of the parameters may cost, dB of the PSNR of training views.
    pub prune_db: f64,
    /// Mean squared error that is good enough: added to that of the model where parameters are priced.
    pub floor: f64,
    /// Parameters to which the model must come down by the last round, whatever that costs; no more than that is pruned.
    pub budget: Option<usize>,
    /// Whether a model within its budget is pruned by [`Self::prune_db`].
    pub by_need: bool,
    /// Rounds to come, with this one.
    pub rounds_left: u32,
    /// Steps done.
    pub step: u32,
    /// Views that are probed.
    pub probes: usize,
    /// Whether the policy fixes the sizes of maps.
    pub keeps_maps: bool,
    /// Colour behind all splats.
    pub background: [f32; 3],
    /// SH degree in use.
    pub sh_degree: u32,
    /// Seed of views, signs and what may be removed.
    pub seed: u64,
    /// How merges are tried; `None`: nothing is merged.
    trial: Option<Trial>,
}

/// What a round did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pruned {
    /// Steps done before it.
    pub step: u32,
    /// Splats removed.
    pub splats: usize,
    /// Splats that were merged with others, less those that came of it.
    pub merged: usize,
    /// Splats that lost SH bands.
    pub degrees: usize,
    /// Maps cropped, coarsened or dropped.
    pub maps: usize,
    /// Parameters before.
    pub params_before: usize,
    /// Parameters after.
    pub params: usize,
    /// Texels after.
    pub texels: usize,
    /// Predicted loss, dB of PSNR; of the last attempt, if all were undone.
    pub predicted_db: f64,
    /// Loss on the views checked, dB of PSNR.
    pub measured_db: f64,
}

impl Pruned {
    /// How far the mean squared error may rise for it at this threshold; at least by `slack`.
    fn allowed(&self, threshold: f64, slack: f64) -> f64 {
        (threshold * (self.params_before - self.params) as f64).max(slack)
    }
}

/// The training views and their photos.
pub(super) struct TrainingViews<'a> {
    pub views: &'a dyn ViewSource,
    pub train_views: &'a [usize],
    pub targets: &'a mut Targets,
    pub exposures: &'a Exposures,
}

impl Round {
    /// The round of a run that follows a step; with this one, `rounds_left` are still to come.
    pub fn of(config: &TrainConfig, schedule: &Schedule, step: u32) -> Self {
        let density = &config.density;
        let keeps_maps = matches!(config.policy.spec().map_rule, MapRule::Fixed(_));
        let trial = Trial {
            limits: Limits {
                widest_px: density.split_texels[1] * density.min_texel_px / 3.0,
                finest_px: density.min_texel_px,
                alpha_texture: density.alpha_texture,
            },
            steps: trial_steps(config.steps, schedule.prune_rounds),
            loss: config.loss,
            rates: schedule.rates(config, step + 1),
        };
        Self {
            prune_db: density.prune_db,
            floor: 10.0_f64.powf(-density.floor_db / 10.0),
            budget: config.budget.max_params,
            by_need: density.need_db > 0.0,
            rounds_left: schedule.rounds_left(step),
            step,
            probes: MOST_PROBES,
            keeps_maps,
            background: config.background,
            sh_degree: schedule.sh_degree(step, config.sh_degree),
            seed: RandomStream::Revision.seed(config.seed, step),
            trial: (density.merge && !keeps_maps).then_some(trial),
        }
    }

    /// Does the round, and brings the histories of the splats along. Returns what it did; `None` if there is nothing to
    /// prune. The statistics of the backend are then to be set anew.
    ///
    /// # Errors
    /// Whatever the backend or the views report; the state is then that before the round, if the backend still works.
    pub(super) fn run(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        histories: &mut Vec<SplatHistory>,
    ) -> Result<Option<Pruned>> {
        let before = backend.read_back()?;
        let mut after = histories.clone();
        let outcome = self.run_from(backend, training, &before, &mut after);
        match outcome {
            Ok(_) => *histories = after,
            // Only the first error is reported.
            Err(_) => drop(backend.upload(&before.0, &before.1)),
        }
        outcome
    }

    fn run_from(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        before: &(Model, AdamState),
        histories: &mut Vec<SplatHistory>,
    ) -> Result<Option<Pruned>> {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed);
        let mut order = training.train_views.to_vec();
        order.shuffle(&mut rng);
        let checked: Vec<usize> = order.iter().rev().take(CHECKED_VIEWS).copied().collect();
        let probed = probed(backend.read_flushed()?);
        let params = probed.num_params();
        // An even part of what is too much for the budget.
        let excess = self.budget.map(|most| params.saturating_sub(most).div_ceil(self.rounds_left as usize));
        if excess == Some(0) {
            let by_need = Self { budget: None, ..*self };
            return if self.by_need {
                by_need.run_from(backend, training, before, histories)
            } else {
                Ok(None)
            };
        }
        let error = self.error(backend, training, &checked)?;
        let offers = self.probe(backend, training, &probed, &order, &mut rng)?;
        // A budget holds whatever it costs.
        let is_bound = self.budget.is_some() && self.rounds_left == 1;
        let removable = if is_bound { 1.0 } else { REMOVABLE };
        let may_go: Vec<bool> = (0..probed.num_splats()).map(|_| rng.random_bool(removable)).collect();
        let threshold = match excess {
            None => self.threshold(error, params),
            Some(excess) => threshold_for(&offers, &may_go, excess),
        };
        // What the model may lose before it is no longer good enough: merges have what these offers leave.
        let slack = CUT_SLACK * (self.good_enough() - error).max(0.0);
        let cut = self.cut(
            backend,
            training,
            before,
            &offers,
            (&may_go, threshold, error, slack),
            (&order, &checked),
        )?;
        let (mut outcome, plan) = cut.map_or((None, None), |(outcome, plan)| (Some(outcome), plan));
        let is_cut = plan.is_some();
        let sources = plan.map_or_else(|| (0..probed.num_splats() as u32).collect(), |plan| plan.sources);
        *histories = sources.iter().map(|&source| histories[source as usize]).collect();
        if let Some(trial) = self.trial.as_ref().filter(|_| error < self.good_enough()) {
            let costs: Vec<Option<SplatCosts>> =
                sources.iter().map(|&source| offers.costs(source as usize)).collect();
            let merged = self.merge(backend, training, trial, (&order, &checked), threshold, &costs)?;
            if let Some(merged) = merged {
                let none = Pruned { step: self.step, params_before: params, ..Pruned::default() };
                let outcome = outcome.insert(outcome.filter(|_| is_cut).unwrap_or(none));
                outcome.predicted_db += db(merged.predicted, error);
                outcome.measured_db += db(merged.measured, error);
                outcome.merged = sources.len() - merged.sources.len();
                (outcome.params, outcome.texels) = (merged.params, merged.texels);
                *histories = merged.histories(histories);
            }
        }
        Ok(outcome)
    }

    /// Probes views in this order. Leaves the probed model in the backend.
    fn probe<'m>(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        probed: &'m Model,
        order: &[usize],
        rng: &mut Pcg64Mcg,
    ) -> Result<Offers<'m>> {
        let mut offers = Offers::new(probed, order.len() > self.probes, self.keeps_maps);
        for &view in order.iter().take(self.probes) {
            let photo = training.targets.get(training.views, view)?;
            let view = self.view(training, view, &photo);
            let view = ProbeView { camera: smaller(&view.camera), ..view };
            let derivatives = probe(backend, probed, &view, rng.random())?;
            offers.observe(&derivatives);
        }
        Ok(offers)
    }

    /// Mean squared error up to which a model is good enough. With a budget none is: it gets the best that fits.
    fn good_enough(&self) -> f64 {
        if self.budget.is_none() { self.floor } else { 0.0 }
    }

    /// The threshold without a budget.
    fn threshold(&self, error: f64, params: usize) -> f64 {
        (error + self.floor) * (10.0_f64.powf(self.prune_db / 10.0) - 1.0) / (THRESHOLD_SHARE * params as f64)
    }

    fn view<'p>(&self, training: &TrainingViews<'_>, view: usize, photo: &'p TargetImage) -> ProbeView<'p> {
        let camera = training.targets.camera(training.views, view);
        ProbeView { camera, photo, background: self.background, sh_degree: self.sh_degree }
    }

    fn error(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        views: &[usize],
    ) -> Result<f64> {
        let photos: Vec<Arc<TargetImage>> =
            views.iter().map(|&view| training.targets.get(training.views, view)).collect::<Result<_>>()?;
        let exposure = |view: usize| -> Option<ColourMap> { training.exposures.of(view) };
        let views: Vec<_> = views
            .iter()
            .zip(&photos)
            .map(|(&view, photo)| (self.view(training, view, photo), exposure(view)))
            .collect();
        mean_squared_error(backend, &views)
    }
}

/// The camera of a probe, with fewer pixels.
fn smaller(camera: &Camera) -> Camera {
    let [width_px, height_px] = [camera.pinhole.width_px, camera.pinhole.height_px]
        .map(|side| ((f64::from(side) * PROBE_SCALE).round() as u32).max(1));
    camera.resized(width_px, height_px)
}

/// Steps of one training in a trial of merges. All trainings of a run, in each round one without merges and up to [`TRIALS`]
/// with them, take at most a fiftieth of its steps, unless it is short.
fn trial_steps(steps: u32, rounds: u32) -> u32 {
    let trained = rounds.max(1) * (1 + TRIALS as u32);
    (steps / STEPS_PER_TRIAL_STEP / trained).clamp(TRIAL_STEPS[0], TRIAL_STEPS[1])
}

/// The loss of PSNR if a mean squared error rises, dB.
fn db(rise: f64, error: f64) -> f64 {
    10.0 * (1.0 + rise / error.max(f64::MIN_POSITIVE)).log10()
}
