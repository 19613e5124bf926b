//! A density-control step of the policy `litetex` and its relatives: reads what the window found, decides what
//! becomes of every splat and its map, and writes the plan (method sections 6 and 7).

use super::candidate::Candidate;
use super::draft::{Draft, finish};
use super::geometry::{half_extents, opacity, pixel_sizes, sigmas};
use super::life::Life;
use super::maps::{self, MapRule, Sizes};
use super::score::{Scores, marks_after};
use super::settings::{Budget, Components, DensityConfig};
use super::spend::Spender;
use crate::backend::{DensityPlan, MapChange, WindowStatistics};
use crate::camera::Camera;
use crate::model::Model;
use serde::Serialize;

/// Opacity below which even fresh children are removed.
const CHILD_OPACITY_MIN: f64 = 0.01;

/// What the step is decided from.
pub struct Situation<'a> {
    /// The flushed model.
    pub model: &'a Model,
    /// Records of its splats.
    pub lives: &'a [Life],
    /// Sums of the window.
    pub statistics: &'a WindowStatistics,
    /// Cameras of the training views, at full size.
    pub cameras: &'a [Camera],
    /// Full size of the images over their size in training, now.
    pub render_scale: f64,
    /// Most texels a side of any map, now.
    pub texture_cap: u16,
    /// Whether maps may grow and splats may split.
    pub densify: bool,
    /// Whether the window's statistics may be used to judge: from the first density-control step on.
    pub judge: bool,
    /// Whether texels have been trained long enough for their values to tell something.
    pub texels_trained: bool,
    /// Whether maps are tested for coarsening.
    pub may_coarsen: bool,
    /// Most splats that may be added.
    pub max_added: usize,
    /// Splats at the start of the run.
    pub initial_splats: usize,
    /// More texels a side than this make a splat long enough to split.
    pub split_texels: f64,
    /// Consecutive marks that remove a splat.
    pub patience: u16,
    /// Opacity below which splats are removed.
    pub opacity_floor: f64,
    /// `fixed:R`, or maps of their own size.
    pub rule: MapRule,
}

/// What a density-control step did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DensityCounts {
    /// Splats removed because they contributed or covered too little.
    pub pruned: usize,
    /// Splats removed because they were nearly transparent.
    pub faded: usize,
    /// Splats replaced by two.
    pub split: usize,
    /// Removed splats made up for where the error is (policy `plain`; `litetex` with `respawn`).
    pub moved: usize,
    /// Maps of twice the texels a side.
    pub refined: usize,
    /// Maps of half the texels a side.
    pub coarsened: usize,
    /// Candidates left as they were because the budget is spent.
    pub over_budget: usize,
}

/// A decided step.
pub struct Revision {
    /// `None` if nothing changes.
    pub plan: Option<DensityPlan>,
    /// Records of the splats after the plan.
    pub lives: Vec<Life>,
    /// What was done.
    pub counts: DensityCounts,
}

/// Decides a density-control step.
pub fn decide(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    budget: &Budget,
) -> Revision {
    let n = s.model.num_splats();
    let scores = Scores::new(s.statistics, s.cameras.len(), config.error, config.prune_contribution);
    let pixels = pixel_sizes(s.model, s.cameras);
    let worst = if s.judge && s.densify { scores.worst(config.quantile) } else { vec![false; n] };
    let mut counts = DensityCounts::default();
    let mut drafts: Vec<Option<Draft>> = (0..n)
        .map(|i| {
            let life = judged(s, config, components, &scores, i, &mut counts)?;
            let extents = half_extents(sigmas(s.model, i), opacity(s.model, i), config.alpha_texture);
            let sizes = Sizes {
                extents,
                finest: config.min_texel_px * pixels[i] * s.render_scale,
                cap: s.texture_cap,
            };
            Some(Draft { source: i as u32, change: MapChange::Keep, edit: None, life, sizes, texels: 0 })
        })
        .collect();
    // Nothing may be added to an empty model, and nobody wants one.
    if drafts.iter().all(Option::is_none) {
        return Revision { plan: None, lives: s.lives.to_vec(), counts: DensityCounts::default() };
    }
    for draft in drafts.iter_mut().flatten() {
        let i = draft.source as usize;
        maps::fit(s, config, components, s.may_coarsen && !worst[i], draft, &mut counts);
    }

    maps::shrink_to_budget(s, budget, &scores, &mut drafts, &mut counts);
    let mut candidates: Vec<Candidate> = (0..n)
        .filter(|&i| worst[i])
        .filter_map(|i| {
            let draft = drafts[i].as_ref()?;
            Some(Candidate::new(s, config, components, draft, scores.error[i], pixels[i]))
        })
        .collect();
    candidates.sort_by(|a, b| b.rank.total_cmp(&a.rank).then(a.splat.cmp(&b.splat)));
    let mut spender = Spender::new(s, config, budget, drafts);
    let mut rest = spender.spend(&candidates, &mut counts);
    if config.respawn && components.splitting {
        rest.sort_by(|a, b| b.error.total_cmp(&a.error).then(a.splat.cmp(&b.splat)));
        spender.respawn(&rest, &pixels, &mut counts);
    }
    let (plan, lives) = finish(s.model, spender.into_drafts());
    Revision { plan, lives, counts }
}

/// The record of a splat after this check; `None` if it is removed.
fn judged(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    scores: &Scores,
    i: usize,
    counts: &mut DensityCounts,
) -> Option<Life> {
    let mut life = s.lives[i];
    if !s.judge {
        return Some(life);
    }
    // Narrow splats can miss every pixel of a coarse image: those windows only clear marks.
    let low = scores.contribution[i] < config.prune_contribution || scores.area[i] < config.prune_area;
    let reliable = s.render_scale < 3.0;
    let judgeable = scores.seen[i] && !life.is_fresh() && (reliable || !low);
    life.marks = marks_after(life.marks, judgeable.then_some(low));
    let faded = if life.is_fresh() { CHILD_OPACITY_MIN } else { s.opacity_floor };
    life.checks = life.checks.saturating_add(1);
    if components.pruning && life.marks >= s.patience {
        counts.pruned += 1;
        return None;
    }
    if opacity(s.model, i) < faded {
        counts.faded += 1;
        return None;
    }
    Some(life)
}
