//! Takes what is cheap enough from a model, and checks on views what that costs.

use super::accept::{accept, planned};
use super::offers::{KINDS, Offers, Thresholds};
use super::round::{Pruned, RAISES, Round, TrainingViews, db};
use crate::Result;
use crate::backend::{Backend, DensityPlan, SavedState};

/// Attempts for each kind of offer, each at half the threshold of the one before; a raised threshold is followed by one that is
/// not.
const ATTEMPTS: i32 = 3;

/// What a cut is decided from.
pub(super) struct Cut<'a> {
    /// The offers, of the model as it was probed.
    pub offers: &'a Offers<'a>,
    /// Whether each splat may be removed.
    pub may_go: &'a [bool],
    /// Threshold, squared error per unit of the price.
    pub threshold: f64,
    /// Views on which every attempt is checked.
    pub checked: &'a [usize],
    /// Their mean squared error before.
    pub error: f64,
    /// Further views on which the outcome is checked.
    pub more: &'a [usize],
    /// How far the error may rise in any case.
    pub slack: f64,
}

/// What an attempt did.
struct Attempt {
    outcome: Pruned,
    plan: DensityPlan,
    /// Rise of the error of the views checked; `None` if nothing was taken, or everything.
    rise: Option<f64>,
    /// How far it may rise for what was taken.
    allowed: f64,
    is_cheap: bool,
}

impl Round {
    /// Takes the offers that cost less than the threshold. Returns what that did, and the plan that the backend carried out,
    /// unless it was undone.
    pub(super) fn cut(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        before: &SavedState,
        cut: &Cut<'_>,
    ) -> Result<Option<(Pruned, Option<DensityPlan>)>> {
        let Cut { offers, may_go, threshold, checked, error, more, slack } = *cut;
        backend.restore(before)?;
        let params = offers.model().num_params();
        let error_of_more = if more.is_empty() { 0.0 } else { self.error(backend, training, more)? };
        let mut start = threshold;
        if !self.is_bounded() {
            let is_good_enough = |raise: &&f64| {
                let accepted = accept(offers, may_go, &Thresholds::all(*raise * threshold));
                accepted.iter().flatten().map(|offer| offer.cost).sum::<f64>() <= slack
            };
            start *= RAISES.iter().find(is_good_enough).unwrap_or(&1.0);
        }
        let mut attempt = self.attempt(backend, training, cut, &Thresholds::all(start), slack)?;
        if !self.is_bounded() && !attempt.is_cheap && attempt.outcome.params < params {
            // Predictions are better for some kinds than for others, and differ between captures.
            let mut thresholds = Thresholds::default();
            for kind in 0..KINDS {
                let halved = (0..ATTEMPTS).map(|halvings| start / 2.0_f64.powi(halvings));
                for tried in halved.chain((start > threshold).then_some(threshold)) {
                    backend.restore(before)?;
                    let only = Thresholds::all(tried).only(kind);
                    if self.attempt(backend, training, cut, &only, slack / KINDS as f64)?.is_cheap {
                        thresholds = thresholds.with(kind, tried);
                        break;
                    }
                }
            }
            backend.restore(before)?;
            attempt = self.attempt(backend, training, cut, &thresholds, slack)?;
        }
        let Attempt { mut outcome, plan, rise, allowed, mut is_cheap } = attempt;
        let Some(rise) = rise else { return Ok(None) };
        if is_cheap && !more.is_empty() {
            let share = more.len() as f64 / (checked.len() + more.len()) as f64;
            let rise_of_more = self.error(backend, training, more)? - error_of_more;
            let [error, rise] = [[error, error_of_more], [rise, rise_of_more]]
                .map(|[checked, more]| checked + share * (more - checked));
            outcome.measured_db = db(rise, error);
            is_cheap = rise <= allowed.max(slack);
        }
        // A budget must be met, whatever the views say.
        if is_cheap || self.is_bounded() {
            return Ok(Some((outcome, Some(plan))));
        }
        backend.restore(before)?;
        (outcome.splats, outcome.degrees, outcome.maps) = (0, 0, 0);
        (outcome.params, outcome.texels) = (params, offers.model().num_texels());
        Ok(Some((outcome, None)))
    }

    /// Takes the offers at these thresholds from the model in the backend, and checks on views whether that is cheap enough.
    fn attempt(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        cut: &Cut<'_>,
        thresholds: &Thresholds,
        slack: f64,
    ) -> Result<Attempt> {
        let accepted = accept(cut.offers, cut.may_go, thresholds);
        let predicted: f64 = accepted.iter().flatten().map(|offer| offer.cost).sum();
        let (mut outcome, plan) = planned(cut.offers.model(), &accepted);
        // A model without splats could not be trained any further.
        if outcome.params == outcome.params_before || plan.sources.is_empty() {
            return Ok(Attempt { outcome, plan, rise: None, allowed: 0.0, is_cheap: false });
        }
        backend.apply_plan(&plan)?;
        let rise = self.error(backend, training, cut.checked)? - cut.error;
        (outcome.step, outcome.predicted_db, outcome.measured_db) =
            (self.step, db(predicted, cut.error), db(rise, cut.error));
        let allowed = cut.threshold * accepted.iter().flatten().map(|offer| offer.price).sum::<f64>();
        Ok(Attempt { outcome, plan, rise: Some(rise), allowed, is_cheap: rise <= allowed.max(slack) })
    }
}
