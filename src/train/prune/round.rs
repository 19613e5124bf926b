//! A round of pruning: what it aims at, what it did, and the error that it watches.

use crate::Result;
use crate::backend::{Backend, ComparedView, LearningRates, LossWeights, TargetImage};
use crate::train::charge::Charge;
use crate::train::config::TrainConfig;
use crate::train::density::MapRule;
use crate::train::exposure::Exposures;
use crate::train::random::RandomStream;
use crate::train::schedule::Schedule;
use crate::train::targets::Targets;
use crate::views::ViewSource;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The share of the parameters that [`Round::prune_db`] is asked of.
const THRESHOLD_SHARE: f64 = 0.1;

/// Threshold, squared error per parameter, that is beyond anything on offer.
pub const MOST_THRESHOLD: f64 = 1.0;

/// Factors by which thresholds may be raised, the highest first, while the model is better than good enough.
pub const RAISES: [f64; 6] = [1024.0, 256.0, 64.0, 16.0, 4.0, 1.0];

/// All trials of merges together take one in this many steps of a run; least and most steps of one training.
const STEPS_PER_TRIAL_STEP: u32 = 50;
const TRIAL_STEPS: [u32; 2] = [8, 64];

/// Trials of one round: merges at a lower threshold are tried if those before cost too much.
pub const TRIALS: usize = 2;

/// Largest standard deviation of a merged splat, in finest texels: that of the shortest splats that are split. Not measured.
const WIDEST_TEXELS: f64 = 16.0 / 3.0;

/// Bounds of merged splats.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Largest standard deviation, pixels of the nearest view: large splats suffer from the order by centres.
    pub widest_px: f64,
    /// Finest texel, pixels of the nearest view.
    pub finest_px: f64,
    /// Alpha at which maps end.
    pub alpha_texture: f64,
}

/// Training of a trial.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// Bounds of merged splats.
    pub limits: Limits,
    /// Steps.
    pub steps: u32,
    /// Weights of the loss terms.
    pub loss: LossWeights,
    /// Learning rates.
    pub rates: LearningRates,
}

/// A round of pruning.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// What the loss of the last 10 % of the parameters may cost, dB of the PSNR of training views.
    pub prune_db: f64,
    /// Mean squared error that is good enough: added to that of the model where the threshold is set.
    pub floor: f64,
    /// Parameters to which the model must come down by the last round, whatever that costs; no more than that is pruned.
    pub budget: Option<usize>,
    /// Bytes of the file, as [`Charge::BYTES`] counts them, to which it must come down likewise, if the file has a wanted size.
    pub max_bytes: Option<f64>,
    /// How much all rasterised fragments together count, over what the charge of the model counts.
    pub price_fragments: f64,
    /// Whether a model within its budget is pruned by [`Self::prune_db`].
    pub by_need: bool,
    /// Rounds to come, with this one.
    pub rounds_left: u32,
    /// Steps done.
    pub step: u32,
    /// Whether the policy fixes the sizes of maps.
    pub keeps_maps: bool,
    /// Colour behind all splats.
    pub background: [f32; 3],
    /// SH degree in use.
    pub sh_degree: u32,
    /// Seed of views, signs and what may be removed.
    pub seed: u64,
    /// How merges are tried; `None`: nothing is merged.
    pub trial: Option<Trial>,
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

/// The training views and their photos.
pub struct TrainingViews<'a> {
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
                widest_px: WIDEST_TEXELS * density.min_texel_px,
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
            budget: config.most_params(),
            max_bytes: None,
            price_fragments: density.price_fragments,
            by_need: density.need_db > 0.0,
            rounds_left: schedule.rounds_left(step),
            step,
            keeps_maps,
            background: config.background,
            sh_degree: schedule.sh_degree(step, config.sh_degree),
            seed: RandomStream::Pruning.seed(config.seed, step),
            trial: (density.merge && !keeps_maps).then_some(trial),
        }
    }

    /// Whether the model must come down to some size.
    pub fn is_bounded(&self) -> bool {
        self.budget.is_some() || self.max_bytes.is_some()
    }

    /// What the model is charged for.
    pub fn charge(&self) -> Charge {
        Charge::for_file(self.max_bytes.is_some())
    }

    /// Mean squared error up to which a model is good enough. With a bound none is: it gets the best that fits.
    pub fn good_enough(&self) -> f64 {
        if self.is_bounded() { 0.0 } else { self.floor }
    }

    /// The threshold without a budget.
    pub fn threshold(&self, error: f64, params: usize) -> f64 {
        (error + self.floor) * (10.0_f64.powf(self.prune_db / 10.0) - 1.0) / (THRESHOLD_SHARE * params as f64)
    }

    /// Mean squared error of views, with the exposures of their photos.
    pub fn error(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        views: &[usize],
    ) -> Result<f64> {
        let photos: Vec<Arc<TargetImage>> =
            views.iter().map(|&view| training.targets.get(training.views, view)).collect::<Result<_>>()?;
        let compared = |(&view, target)| ComparedView {
            camera: training.targets.camera(training.views, view),
            photo: Some(training.targets.photo(view)),
            target,
            background: self.background,
            sh_degree: self.sh_degree,
            exposure: training.exposures.of(view),
        };
        let compared: Vec<ComparedView<'_>> =
            views.iter().zip(photos.iter().map(Arc::as_ref)).map(compared).collect();
        Ok(backend.squared_errors(&compared)?.iter().sum::<f64>() / views.len().max(1) as f64)
    }
}

/// Steps of one training in a trial of merges. All trainings of a run, in each round one without merges and up to [`TRIALS`]
/// with them, take at most a fiftieth of its steps, unless it is short.
pub fn trial_steps(steps: u32, rounds: u32) -> u32 {
    let trained = rounds.max(1) * (1 + TRIALS as u32);
    (steps / STEPS_PER_TRIAL_STEP / trained).clamp(TRIAL_STEPS[0], TRIAL_STEPS[1])
}

/// The loss of PSNR if a mean squared error rises, dB.
pub fn db(rise: f64, error: f64) -> f64 {
    10.0 * (1.0 + rise / error.max(f64::MIN_POSITIVE)).log10()
}
