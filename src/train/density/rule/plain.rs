//! Growth of the policy `plain` (method 6.12), the strongest untextured baseline that we know. Faded splats are
//! relocated to where the error is, and the model grows to its budget, both by splitting splats drawn by the error that they
//! carry. This is the relocation of 3DGS-MCMC with halves instead of copies, because coincident copies would always have equal
//! gradients.

use super::prepare::unchanged;
use super::spec::{RuleSpec, SPLIT_RATE, SplitShare};
use crate::train::density::draw::draw_order;
use crate::train::density::geometry::{opacity, pixel_sizes};
use crate::train::density::ops::band;
use crate::train::density::ops::split::{Profile, split_any};
use crate::train::density::plan::Plan;
use crate::train::density::settings::Budget;
use crate::train::density::situation::{DensityCounts, Revision, Situation};
use crate::train::density::stats::{ErrorMeasure, Scores};

/// Least weight of a splat in the draw: one that shows no error may still be split.
const WEIGHT_MIN: f64 = 1e-30;

/// Without a budget the number of splats stays the same (3DGS-MCMC: every 100 steps).
pub fn spec(budget: &Budget) -> RuleSpec {
    let has_budget = budget.max_splats.or(budget.max_params).is_some();
    RuleSpec {
        unused: &[
            "quantile",
            "coarsen-below",
            "grow-by-axis",
            "prune-contribution",
            "prune-area",
            "patience-steps",
        ],
        interval: 100,
        epoch: [1, 25],
        split_share: SplitShare::Fixed(if has_budget { SPLIT_RATE } else { 0.0 }),
        splits_any_length: true,
        is_paced: false,
        ends_by_need: false,
        crops_between: false,
    }
}

/// Decides a density-control step. The model gains up to as many splats as the timetable allows besides those that replace faded
/// ones.
pub fn revise(s: &Situation<'_>) -> Revision {
    let n = s.model.num_splats();
    // By mass: splats that carry much error are those where more splats help.
    let scores = Scores::new(s.statistics, s.cameras.len(), ErrorMeasure::Mass, 0.0);
    let pixels = pixel_sizes(s.model, s.cameras);
    let alive: Vec<usize> = (0..n).filter(|&i| opacity(s.model, i) >= s.timing.opacity_floor).collect();
    if alive.is_empty() || !s.timing.grows {
        return Revision::none(s);
    }
    let mut counts = DensityCounts::default();
    let mut planned = vec![None; n];
    let mut bands = Vec::new();
    for &splat in &alive {
        let mut parent = unchanged(s, splat, pixels[splat]);
        bands.extend(band::test(s, &scores, &mut parent, &mut counts).map(|saved| (saved, splat)));
        planned[splat] = Some(parent);
    }
    let mut plan = Plan::new(planned, s.bound());
    bands.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for (_, splat) in bands {
        let gained = plan.splat(splat).map(band::gained);
        counts.bands_gained += usize::from(gained.is_some_and(|gained| plan.replace(splat, &[gained])));
    }

    let faded = n - alive.len();
    let wanted = (faded + s.timing.max_splits).min(alive.len());
    let mut added = 0;
    for place in draw_order(alive.iter().map(|&i| scores.error[i].max(WEIGHT_MIN)), s.seed) {
        if added == wanted {
            break;
        }
        let Some(parent) = plan.splat(alive[place]) else { continue };
        let halves = split_any(s, Profile::Tight, parent);
        added += usize::from(plan.replace(alive[place], &halves));
    }
    counts.respawned = faded.min(added);
    (counts.split, counts.faded) = (added - counts.respawned, faded - counts.respawned);
    plan.finish(s.model, counts)
}
