//! A density-control step of the policy `plain` (method 6.12), the strongest untextured baseline that we know. Faded splats are
//! relocated to where the error is, and the model grows to its budget, both by splitting splats drawn by the error that they
//! carry. This is the relocation of 3DGS-MCMC with halves instead of copies, because coincident copies would always have equal
//! gradients.

use super::draw::{SPLIT_RATE, draw_order};
use super::geometry::opacity;
use super::planned_splat::{PlannedSplat, finish, size_of, with};
use super::score::Scores;
use super::settings::{Budget, DensityConfig, ErrorMeasure, SplitProfile};
use super::shading;
use super::situation::{DensityCounts, Revision, Situation};
use super::sizes::Sizes;
use super::split::split_of_any_length;
use crate::backend::MapChange;

/// Decides a relocation. The model grows to `budget`; with `None` the number of splats stays the same.
pub fn relocate(s: &Situation<'_>, config: &DensityConfig, budget: Option<&Budget>) -> Revision {
    let n = s.model.num_splats();
    // By mass, whatever the settings: splats that carry much error are those where more splats help.
    let scores = Scores::new(s.statistics, s.cameras.len(), ErrorMeasure::Mass, 0.0);
    let planned = |i: usize| PlannedSplat {
        source: i as u32,
        change: MapChange::Keep,
        edit: None,
        history: s.histories[i],
        sizes: Sizes { cap: 0, ..Sizes::default() },
        texels: 0,
        sh_degree: s.model.splats.sh_degrees()[i],
    };
    let alive: Vec<usize> = (0..n).filter(|&i| opacity(s.model, i) >= config.relocate_below).collect();
    let faded = n - alive.len();
    if alive.is_empty() || !s.densify {
        let (histories, counts) = (s.histories.to_vec(), DensityCounts::default());
        return Revision { plan: None, histories, counts, growth: s.growth };
    }
    let wanted = if budget.is_some() { (n as f64 * (1.0 + SPLIT_RATE)) as usize } else { n };
    let wanted = wanted.saturating_sub(alive.len()).min(alive.len());
    let mut counts = DensityCounts::default();
    let mut offers = Vec::new();
    let mut parents: Vec<PlannedSplat> = alive
        .iter()
        .map(|&i| {
            let mut planned = planned(i);
            offers.extend(shading::shade(s, config, &scores, &mut planned, &mut counts));
            planned
        })
        .collect();
    shading::raise(&mut offers, &mut parents, budget, &mut counts);

    let (mut chosen, mut added) = (vec![false; parents.len()], 0);
    let mut size = size_of(&parents);
    for k in draw_order(alive.iter().map(|&i| scores.error[i].max(1e-30)), s.seed) {
        let grown = with(size, &parents[k]);
        if added < wanted && budget.is_none_or(|budget| budget.allows(&grown)) {
            (size, chosen[k], added) = (grown, true, added + 1);
        }
    }
    let mut planned_splats = Vec::with_capacity(alive.len() + added);
    for (parent, is_chosen) in parents.into_iter().zip(chosen) {
        if is_chosen {
            planned_splats.extend(split_of_any_length(s, config, &parent, SplitProfile::Tight));
        } else {
            planned_splats.push(parent);
        }
    }
    let respawned = faded.min(added);
    let counts = DensityCounts { respawned, split: added - respawned, faded: faded - respawned, ..counts };
    let (plan, histories) = finish(s.model, planned_splats);
    Revision { plan, histories, counts, growth: s.growth }
}
