//! Does a round of pruning.

use super::accept::{Excess, threshold_for};
use super::costs::SplatCosts;
use super::cut::Cut;
use super::offers::Offers;
use super::round::{Pruned, Round, TrainingViews, db};
use crate::backend::{Backend, Probe, SavedState, probed};
use crate::camera::Camera;
use crate::fragments::rasterised_fragments;
use crate::model::Model;
use crate::train::density::SplatHistory;
use crate::train::schedule::MOST_PROBES;
use crate::{Error, Result};
use rand::seq::SliceRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// Views on which predictions are checked, and those of the last round.
const CHECKED_VIEWS: usize = 8;
const LAST_CHECKED_VIEWS: usize = 32;

/// Width and height of a probe over those of the view. Half of the pixels along each axis lose nothing (method 6.15).
const PROBE_SCALE: f64 = 0.5;

/// Share of the splats that a round may remove: of two that hide the same, one looks as idle as the other.
const REMOVABLE: f64 = 0.5;

/// The share of what a model may lose before it is no longer good enough that is for offers; merges may use up the rest.
const CUT_SLACK: f64 = 0.5;

impl Round {
    /// Does the round, and brings the histories of the splats along. Returns what it did; `None` if there is nothing to
    /// prune. The statistics of the backend are then to be set anew.
    ///
    /// # Errors
    /// Whatever the backend or the views report; the state is then that before the round, if the backend still works.
    pub fn run(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        histories: &mut Vec<SplatHistory>,
    ) -> Result<Option<Pruned>> {
        let before = backend.save()?;
        let mut after = histories.clone();
        let outcome = self.run_from(backend, training, &before, &mut after);
        match outcome {
            Ok(_) => *histories = after,
            Err(Error::DeviceFull(_)) => backend.restore(&before).map_err(|error| match error {
                // The state is lost.
                Error::DeviceFull(no_room) => Error::Device(no_room.to_string()),
                other => other,
            })?,
            // Only the first error is reported.
            Err(_) => drop(backend.restore(&before)),
        }
        outcome
    }

    fn run_from(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        before: &SavedState,
        histories: &mut Vec<SplatHistory>,
    ) -> Result<Option<Pruned>> {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed);
        let mut order = training.train_views.to_vec();
        order.shuffle(&mut rng);
        let last: Vec<usize> = order.iter().rev().take(LAST_CHECKED_VIEWS).copied().collect();
        let (checked, more) = last.split_at(CHECKED_VIEWS.min(last.len()));
        let probed = probed(backend.read_flushed()?);
        let params = probed.num_params();
        // An even part of what is too much.
        let part = |excess: f64| excess.max(0.0) / f64::from(self.rounds_left);
        let excess = self.is_bounded().then(|| Excess {
            params: self.budget.map_or(0, |most| part(params as f64 - most as f64).ceil() as usize),
            charge: self.max_bytes.map_or(0.0, |most| part(self.charge().of_model(&probed) - most)),
        });
        if excess == Some(Excess::default()) {
            let by_need = Self { budget: None, max_bytes: None, ..*self };
            return if self.by_need {
                by_need.run_from(backend, training, before, histories)
            } else {
                Ok(None)
            };
        }
        let error = self.error(backend, training, checked)?;
        let offers = self.probe(backend, training, &probed, &order, &mut rng)?;
        // A budget holds whatever it costs.
        let is_bound = self.is_bounded() && self.rounds_left == 1;
        let removable = if is_bound { 1.0 } else { REMOVABLE };
        let may_go: Vec<bool> = (0..probed.num_splats()).map(|_| rng.random_bool(removable)).collect();
        let threshold = match excess {
            None => self.threshold(error, params),
            Some(excess) => threshold_for(&offers, &may_go, &excess),
        };
        // What the model may lose before it is no longer good enough: merges have what these offers leave.
        let slack = CUT_SLACK * (self.good_enough() - error).max(0.0);
        // The last round without a budget is final: it is checked on more views.
        let more = if !self.is_bounded() && self.rounds_left == 1 { more } else { &[] };
        let cut = Cut { offers: &offers, may_go: &may_go, threshold, checked, error, more, slack };
        let cut = self.cut(backend, training, before, &cut)?;
        let (mut outcome, plan) = cut.map_or((None, None), |(outcome, plan)| (Some(outcome), plan));
        let is_cut = plan.is_some();
        let sources = plan.map_or_else(|| (0..probed.num_splats() as u32).collect(), |plan| plan.sources);
        *histories = sources.iter().map(|&source| histories[source as usize]).collect();
        if let Some(trial) = self.trial.as_ref().filter(|_| error < self.good_enough()) {
            let costs: Vec<Option<SplatCosts>> =
                sources.iter().map(|&source| offers.costs(source as usize)).collect();
            let merged = self.merge(backend, training, trial, (&order, checked), threshold, &costs)?;
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
        let views = &order[..order.len().min(MOST_PROBES)];
        let mut probes = views.iter().map(|&view| -> Result<Probe> {
            let photo = training.targets.get(training.views, view)?;
            let camera = smaller(&training.targets.camera(training.views, view));
            Ok(Probe::new(camera, &photo, self.background, self.sh_degree, rng.random()))
        });
        let costs = backend.probe(&mut probes)?;
        let is_sample = views.len() < order.len();
        let offers = Offers::new(probed, (costs, views.len() as u32), is_sample, self.keeps_maps);
        let offers = offers.with_charge(self.charge());
        if self.price_fragments == 0.0 {
            return Ok(offers);
        }
        // On the host, so that all backends decide alike.
        let camera = |&view: &usize| smaller(&training.targets.camera(training.views, view));
        let cameras: Vec<Camera> = views.iter().map(camera).collect();
        Ok(offers.with_fragments(self.price_fragments, rasterised_fragments(probed, &cameras)))
    }
}

/// The camera of a probe, with fewer pixels.
fn smaller(camera: &Camera) -> Camera {
    let [width_px, height_px] = [camera.pinhole.width_px, camera.pinhole.height_px]
        .map(|side| ((f64::from(side) * PROBE_SCALE).round() as u32).max(1));
    camera.resized(width_px, height_px)
}
