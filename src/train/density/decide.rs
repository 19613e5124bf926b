//! A density-control step of the policy `litetex` and its variants: decides from the statistics window what
//! happens to every splat and its map, and writes the plan (method 6).

use super::budget_allocator::BudgetAllocator;
use super::candidate::Candidate;
use super::draw;
use super::geometry::{half_extents, opacity, pixel_sizes, sigmas};
use super::growth::Kind;
use super::history::{SplatHistory, Trial};
use super::in_vain::grew_in_vain;
use super::maps;
use super::outcome::Outcomes;
use super::planned_splat::{PlannedSplat, finish};
use super::score::{Scores, prune_count_after};
use super::settings::{Budget, Components, DensityConfig};
use super::shading;
use super::situation::{DensityCounts, Revision, Situation};
use super::sizes::Sizes;
use crate::backend::MapChange;

/// Opacity below which even fresh halves fade.
const FRESH_OPACITY_MIN: f64 = 0.01;

/// Decides a density-control step: prune and fade, judge SH bands, fit, coarsen, refine or split, respawn.
pub fn decide(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    budget: &Budget,
) -> Revision {
    let n = s.model.num_splats();
    let scores = Scores::new(s.statistics, s.cameras.len(), config.error, config.prune_contribution);
    let window = Outcomes::new(s.histories, &scores);
    let mut growth = s.growth;
    let is_comparable = s.use_statistics && !s.images_resized;
    if is_comparable {
        growth.observe(&window, s.histories, &scores);
    }
    let densify = s.densify && !growth.has_ended();
    let in_vain = match is_comparable && config.need_db > 0.0 {
        true => grew_in_vain(s.histories, &scores, &window),
        false => vec![false; n],
    };
    let pixels = pixel_sizes(s.model, s.cameras);
    let high_error =
        if s.use_statistics && densify { scores.high_error(config.quantile) } else { vec![false; n] };
    let mut counts = DensityCounts::default();
    let mut planned_splats: Vec<Option<PlannedSplat>> = (0..n)
        .map(|i| {
            let history = checked(s, config, components, (&scores, in_vain[i]), i, &mut counts)?;
            let extents = half_extents(sigmas(s.model, i), opacity(s.model, i), config.alpha_texture);
            let sizes = Sizes {
                extents,
                finest: config.min_texel_px * pixels[i] * s.render_scale,
                cap: s.texture_cap,
            };
            Some(PlannedSplat {
                source: i as u32,
                change: MapChange::Keep,
                edit: None,
                history,
                sizes,
                texels: 0,
                sh_degree: s.model.splats.sh_degrees()[i],
            })
        })
        .collect();
    // Never prune every splat: nothing can be added to an empty model.
    if planned_splats.iter().all(Option::is_none) {
        let (histories, counts) = (s.histories.to_vec(), DensityCounts::default());
        return Revision { plan: None, histories, counts, growth };
    }
    let mut bands = Vec::new();
    for planned in planned_splats.iter_mut().flatten() {
        let i = planned.source as usize;
        bands.extend(shading::shade(s, config, &scores, planned, &mut counts));
        maps::fit(s, config, components, s.may_coarsen && !high_error[i], planned, &mut counts);
        if in_vain[i]
            && let Some(axes) = s.histories[i].trial.refined_axes()
        {
            maps::take_back(s, axes, planned, &mut counts);
        }
    }

    let draws = s.draws_growth && s.use_statistics && densify;
    // Where growth is drawn, bands compete with what else is on offer.
    if densify && !draws {
        shading::raise(&mut bands, planned_splats.iter_mut().flatten(), Some(budget), &mut counts);
    }
    maps::coarsen_to_budget(s, budget, &scores, &mut planned_splats, &mut counts);
    let texel_gain = growth.gain(Kind::Refined, config.texel_gain);
    let mut candidates: Vec<Candidate> = (0..n)
        .filter(|&i| high_error[i])
        .filter_map(|i| {
            let planned = planned_splats[i].as_ref().filter(|planned| planned.history.rest == 0)?;
            Some(Candidate::new(s, config, components, planned, scores.error[i], pixels[i], texel_gain))
        })
        .collect();
    candidates.sort_by(|a, b| b.rank.total_cmp(&a.rank).then(a.splat.cmp(&b.splat)));
    let drawn = draws.then(|| {
        draw::raise_ceilings(&mut planned_splats, &candidates);
        draw::offers(s, config, &planned_splats, &scores.error, &candidates, &bands, &growth)
    });
    let mut allocator = BudgetAllocator::new(s, config, budget, planned_splats);
    let mut rest = match drawn {
        Some(drawn) => allocator.take_drawn(&drawn, &candidates, &mut counts),
        None => allocator.allocate(&candidates, &mut counts),
    };
    if config.respawn && components.splitting {
        rest.sort_by(|a, b| b.error.total_cmp(&a.error).then(a.splat.cmp(&b.splat)));
        allocator.respawn(&rest, &pixels, &mut counts);
    }
    if s.use_statistics && config.need_db > 0.0 {
        growth.judge(s, &candidates, &scores, s.model.num_params(), config.need_db);
    }
    let (plan, histories) = finish(s.model, allocator.into_planned_splats());
    Revision { plan, histories, counts, growth }
}

/// The history of a splat after this check; `None` if it is pruned (method 6.3).
fn checked(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    (scores, grew_in_vain): (&Scores, bool),
    i: usize,
    counts: &mut DensityCounts,
) -> Option<SplatHistory> {
    let mut history = s.histories[i];
    if !s.use_statistics {
        return Some(history);
    }
    let low = scores.contribution[i] < config.prune_contribution || scores.area[i] < config.prune_area;
    // Narrow splats can miss every pixel of a coarse image: such windows can only reset the prune count.
    let reliable = s.render_scale < 3.0;
    let is_counted = scores.seen[i] && !history.is_fresh() && (reliable || !low);
    history.prune_count = prune_count_after(history.prune_count, is_counted.then_some(low));
    let opacity_floor =
        if history.is_fresh() && !s.draws_growth { FRESH_OPACITY_MIN } else { s.opacity_floor };
    history.checks = history.checks.saturating_add(1);
    history.trial = Trial::None;
    history.rest = if grew_in_vain { config.rest_checks } else { history.rest.saturating_sub(1) };
    if s.measures_growth(config) {
        history.error = scores.total[i] as f32;
    }
    if components.pruning && history.prune_count >= s.patience {
        counts.pruned += 1;
        return None;
    }
    if opacity(s.model, i) < opacity_floor {
        counts.faded += 1;
        return None;
    }
    Some(history)
}
