//! Which offers are taken at a threshold, and the plan made of them.

use super::offers::{Accepted, Offers, Thresholds};
use super::round::{MOST_THRESHOLD, Pruned};
use crate::backend::{DensityPlan, MapChange};
use crate::model::Model;
use rayon::prelude::*;

/// Halvings of the range of thresholds, of 46 nats: to 3e-6.
const SEARCH_STEPS: u32 = 24;

/// The best offers at these thresholds.
pub fn accept(offers: &Offers<'_>, may_go: &[bool], thresholds: &Thresholds) -> Vec<Option<Accepted>> {
    may_go.par_iter().enumerate().map(|(splat, &may_go)| offers.best(splat, thresholds, may_go)).collect()
}

/// What is to be pruned at least.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Excess {
    /// Parameters.
    pub params: usize,
    /// Of the charge, if the model is not charged for its parameters.
    pub charge: f64,
}

/// The lowest threshold at which as much is pruned; the highest at which anything changes, if there is too little.
pub fn threshold_for(offers: &Offers<'_>, may_go: &[bool], excess: &Excess) -> f64 {
    // Squared errors per unit of the charge far outside of what occurs.
    let (mut low, mut high) = (1e-20_f64.ln(), MOST_THRESHOLD.ln());
    for _ in 0..SEARCH_STEPS {
        let middle = 0.5 * (low + high);
        let accepted = accept(offers, may_go, &Thresholds::all(middle.exp()));
        let params: usize = accepted.iter().flatten().map(|offer| offer.params).sum();
        let charge: f64 = accepted.iter().flatten().map(|offer| offer.charge).sum();
        if params >= excess.params && charge >= excess.charge { high = middle } else { low = middle }
    }
    high.exp()
}

/// The plan of the offers taken, and what it does.
pub fn planned(model: &Model, accepted: &[Option<Accepted>]) -> (Pruned, DensityPlan) {
    let params = model.num_params();
    let mut outcome = Pruned { params_before: params, params, ..Pruned::default() };
    let mut plan = DensityPlan::default();
    for (splat, accepted) in accepted.iter().enumerate() {
        let held = model.splats.sh_degrees()[splat];
        let map = &model.textures.maps[splat];
        let (degree, map, texels) = match accepted {
            None => (held, MapChange::Keep, map.num_texels()),
            Some(offer) => {
                outcome.params -= offer.params;
                let Some(kept) = offer.kept else {
                    outcome.splats += 1;
                    continue;
                };
                outcome.degrees += usize::from(kept.degree < held);
                outcome.maps += usize::from(kept.map != MapChange::Keep);
                (kept.degree, kept.map, kept.texels)
            }
        };
        outcome.texels += texels;
        plan.sources.push(splat as u32);
        plan.maps.push(map);
        plan.sh_degrees.push(degree);
    }
    (outcome, plan)
}
