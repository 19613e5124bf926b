//! Takes what is cheap enough from a model, and checks on views what that costs.

use super::accept::{accept, planned};
use super::offers::{KINDS, Offers, Thresholds};
use super::round::{Pruned, RAISES, Round, TrainingViews, db};
use crate::backend::{Backend, DensityPlan};
use crate::model::{AdamState, Model};
use crate::{Error, Result};

/// Attempts for each kind of offer, each at half the threshold of the one before; a raised threshold is followed by one that is
/// not.
const ATTEMPTS: i32 = 3;

impl Round {
    /// Takes the offers that cost less than this threshold, where the views `checked` have this error now; splats are removed only
    /// where they `may_go`. Without a budget, the last round is also checked on all views, in this `order`. Returns what that did,
    /// and the plan that the backend carried out, unless it was undone.
    pub(super) fn cut(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        (model, adam): &(Model, AdamState),
        offers: &Offers<'_>,
        (may_go, threshold, error, slack): (&[bool], f64, f64, f64),
        (order, checked): (&[usize], &[usize]),
    ) -> Result<Option<(Pruned, Option<DensityPlan>)>> {
        backend.upload(model, adam)?;
        let probed = offers.model();
        let params = probed.num_params();
        // A budget must be met, whatever the views say.
        let is_last = self.budget.is_none() && self.rounds_left == 1;
        let before = if is_last { Some(self.error(backend, training, order)?) } else { None };
        // Takes the offers at these thresholds. Returns what that does, whether it is cheap enough, and the plan.
        let mut take = |backend: &mut dyn Backend, thresholds: &Thresholds, slack: f64| {
            let accepted = accept(offers, may_go, thresholds);
            let predicted: f64 = accepted.iter().flatten().map(|offer| offer.cost).sum();
            let (mut outcome, plan) = planned(probed, &accepted);
            // A model without splats could not be trained any further.
            if outcome.params == params || plan.sources.is_empty() {
                return Ok((outcome, false, plan));
            }
            backend.apply_plan(&plan)?;
            let rise = self.error(backend, training, checked)? - error;
            (outcome.step, outcome.predicted_db, outcome.measured_db) =
                (self.step, db(predicted, error), db(rise, error));
            Ok::<_, Error>((outcome, rise <= outcome.allowed(threshold, slack), plan))
        };
        let mut start = threshold;
        if self.budget.is_none() {
            let is_good_enough = |raise: &&f64| {
                let accepted = accept(offers, may_go, &Thresholds::all(*raise * threshold));
                accepted.iter().flatten().map(|offer| offer.cost).sum::<f64>() <= slack
            };
            start *= RAISES.iter().find(is_good_enough).unwrap_or(&1.0);
        }
        let (mut outcome, mut is_cheap, mut plan) = take(backend, &Thresholds::all(start), slack)?;
        if self.budget.is_none() && !is_cheap && outcome.params < params {
            // Predictions are better for some kinds than for others, and differ between captures.
            let mut thresholds = Thresholds::default();
            for kind in 0..KINDS {
                let halved = (0..ATTEMPTS).map(|halvings| start / 2.0_f64.powi(halvings));
                for tried in halved.chain((start > threshold).then_some(threshold)) {
                    backend.upload(model, adam)?;
                    if take(backend, &Thresholds::all(tried).only(kind), slack / KINDS as f64)?.1 {
                        thresholds = thresholds.with(kind, tried);
                        break;
                    }
                }
            }
            backend.upload(model, adam)?;
            (outcome, is_cheap, plan) = take(backend, &thresholds, slack)?;
        }
        if outcome.params == params || plan.sources.is_empty() {
            return Ok(None);
        }
        if let Some(before) = before.filter(|_| is_cheap) {
            let rise = self.error(backend, training, order)? - before;
            outcome.measured_db = db(rise, before);
            is_cheap = rise <= outcome.allowed(threshold, slack);
        }
        if is_cheap || self.budget.is_some() {
            return Ok(Some((outcome, Some(plan))));
        }
        backend.upload(model, adam)?;
        (outcome.splats, outcome.degrees, outcome.maps) = (0, 0, 0);
        (outcome.params, outcome.texels) = (params, probed.num_texels());
        Ok(Some((outcome, None)))
    }
}
