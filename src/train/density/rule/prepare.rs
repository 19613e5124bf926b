//! What comes before growth: pruning splats, testing their SH bands, fitting their maps, and bringing the model within its budget.

use crate::backend::MapChange;
use crate::train::density::geometry::{half_extents, opacity, pixel_sizes, sigmas};
use crate::train::density::ops::{band, map};
use crate::train::density::plan::{PlannedSplat, size_of, with, without};
use crate::train::density::situation::{DensityCounts, Situation};
use crate::train::density::sizes::{MapRule, Sizes};
use crate::train::density::stats::{ErrorMeasure, Scores, prune_count_after};
use rayon::prelude::*;
use std::ops::Add;

/// Splats that a thread decides on at a time.
pub const SPLATS_PER_TASK: usize = 512;

/// Full size over image size from which narrow splats can miss every pixel: such windows can only reset prune counts.
const UNRELIABLE_SCALE: f64 = 3.0;

/// Sum over the training views of blending weight per pixel below which a splat counts as free of error (paper, which also
/// prunes such splats).
const LEAST_CONTRIBUTION: f64 = 5e-6;

/// How the rules differ before growth.
pub struct Preparation {
    /// What counts as error.
    pub error: ErrorMeasure,
    /// Opacity below which even fresh halves fade; `None`: that of other splats.
    pub fresh_opacity_floor: Option<f64>,
    /// Whether maps that are idle, or below the finest texel, are dropped.
    pub drops_maps: bool,
}

/// A model that is ready to grow; one value per splat.
pub struct Prepared {
    /// What the window measured.
    pub scores: Scores,
    /// Widths of a pixel at the splats, local units.
    pub pixels: Vec<f64>,
    /// Whether the error is high.
    pub high_error: Vec<bool>,
    /// Whether the splat may gain an SH band.
    pub may_gain_band: Vec<bool>,
    /// The splats; `None`: pruned or faded.
    pub planned: Vec<Option<PlannedSplat>>,
    /// What was done.
    pub counts: DensityCounts,
}

impl Preparation {
    /// Prepares the model; `None` if no splat is left, as nothing can be added to an empty model.
    pub fn prepare(&self, s: &Situation<'_>) -> Option<Prepared> {
        let n = s.model.num_splats();
        let scores = Scores::new(s.statistics, s.cameras.len(), self.error, LEAST_CONTRIBUTION);
        let pixels = pixel_sizes(s.model, s.cameras);
        let high_error = if s.timing.grows { scores.high_error(s.settings.quantile) } else { vec![false; n] };
        let survivors = (0..n).into_par_iter().with_min_len(SPLATS_PER_TASK).map(|splat| {
            let mut counts = DensityCounts::default();
            (self.survivor(s, &scores, unchanged(s, splat, pixels[splat]), &mut counts), counts)
        });
        let (mut planned, removed): (Vec<Option<PlannedSplat>>, Vec<DensityCounts>) = survivors.unzip();
        if planned.iter().all(Option::is_none) {
            return None;
        }
        let mut may_gain_band = vec![false; n];
        let each = planned.par_iter_mut().zip(&mut may_gain_band).with_min_len(SPLATS_PER_TASK);
        let fitted = each.map(|(planned, may_gain_band)| {
            let mut counts = DensityCounts::default();
            let Some(planned) = planned else { return counts };
            *may_gain_band = band::test(s, &scores, planned, &mut counts).is_some();
            let is_high_error = high_error[planned.source as usize];
            let may_coarsen = s.timing.may_coarsen && s.timing.use_statistics && !is_high_error;
            map::fit(s, may_coarsen, self.drops_maps, planned, &mut counts);
            counts
        });
        let mut counts = fitted.reduce(DensityCounts::default, Add::add);
        counts = removed.into_iter().fold(counts, Add::add);
        coarsen_to_budget(s, &scores, &mut planned, &mut counts);
        Some(Prepared { scores, pixels, high_error, may_gain_band, planned, counts })
    }

    /// The splat with its prune count; `None` if it is pruned or faded (method 6.3).
    fn survivor(
        &self,
        s: &Situation<'_>,
        scores: &Scores,
        mut planned: PlannedSplat,
        counts: &mut DensityCounts,
    ) -> Option<PlannedSplat> {
        if !s.timing.use_statistics {
            return Some(planned);
        }
        let splat = planned.source as usize;
        let history = &mut planned.history;
        let low = scores.contribution[splat] < s.settings.prune_contribution
            || scores.area[splat] < s.settings.prune_area;
        let is_reliable = s.render_scale < UNRELIABLE_SCALE || !low;
        let is_counted = scores.seen[splat] && !history.is_fresh() && is_reliable;
        history.prune_count = prune_count_after(history.prune_count, is_counted.then_some(low));
        let fresh_floor = self.fresh_opacity_floor.filter(|_| history.is_fresh());
        history.checks = history.checks.saturating_add(1);
        if s.components.pruning && history.prune_count >= s.timing.patience {
            counts.pruned += 1;
            return None;
        }
        if opacity(s.model, splat) < fresh_floor.unwrap_or(s.timing.opacity_floor) {
            counts.faded += 1;
            return None;
        }
        Some(planned)
    }
}

/// A splat as it is, with the bounds of its map.
pub fn unchanged(s: &Situation<'_>, splat: usize, pixel: f64) -> PlannedSplat {
    let extents = half_extents(sigmas(s.model, splat), opacity(s.model, splat), s.settings.alpha_texture);
    PlannedSplat {
        source: splat as u32,
        change: MapChange::Keep,
        edit: None,
        history: s.histories[splat],
        sizes: Sizes {
            extents,
            finest: s.settings.min_texel_px * pixel * s.render_scale,
            cap: s.texture_cap,
        },
        texels: s.model.textures.maps[splat].num_texels(),
        sh_degree: s.model.splats.sh_degrees()[splat],
    }
}

/// Makes maps smaller, those of the least error first, until the model is within its budget.
fn coarsen_to_budget(
    s: &Situation<'_>,
    scores: &Scores,
    planned_splats: &mut [Option<PlannedSplat>],
    counts: &mut DensityCounts,
) {
    let mut size = size_of(planned_splats.iter().flatten());
    if s.budget.allows(&size) || s.map_rule != MapRule::Adaptive {
        return;
    }
    let mut order: Vec<usize> = (0..planned_splats.len()).filter(|&i| planned_splats[i].is_some()).collect();
    order.sort_by(|&a, &b| scores.error[a].total_cmp(&scores.error[b]).then(a.cmp(&b)));
    // Half the side, then a quarter and so on: padding may have added more than one halving removes.
    for halvings in 1..u16::BITS {
        for &i in &order {
            if s.budget.allows(&size) {
                return;
            }
            let Some(planned) = &mut planned_splats[i] else { continue };
            if let Some(smaller) = map::halved(s, halvings, planned) {
                counts.coarsened += 1;
                size = with(without(size, planned), &smaller);
                *planned = smaller;
            }
        }
    }
}
