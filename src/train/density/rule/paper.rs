//! Growth as published, and by its relatives: the program behind the published tables and content-aware texturing (method 6).
//! High-error splats are split if they are long enough, otherwise their maps are refined, in the order of error.

use super::prepare::{Preparation, Prepared};
use super::spec::{RuleSpec, SplitShare};
use crate::train::density::ops::map::{self, Moments};
use crate::train::density::ops::split::{Profile, split_long};
use crate::train::density::plan::{Plan, PlannedSplat};
use crate::train::density::situation::{DensityCounts, Revision, Situation};
use crate::train::density::stats::ErrorMeasure;

/// Opacity below which even fresh halves fade.
const FRESH_OPACITY_MIN: f64 = 0.01;

/// In what the published methods differ here; in what else they do, see their profiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// What counts as error.
    pub error: ErrorMeasure,
    /// What happens to the moments of a refined map.
    pub moments: Moments,
    /// Initial map ceiling, texels per side.
    pub first_ceiling: u16,
}

/// Maps are fitted two and a half times as often as splats are revised (authors' configuration).
pub fn spec(fewest: u32) -> RuleSpec {
    RuleSpec {
        unused: &["sh-raise"],
        interval: 250,
        epoch: [fewest, 50],
        split_share: SplitShare::Scheduled,
        splits_any_length: false,
        is_paced: true,
        ends_by_need: false,
        crops_between: true,
    }
}

/// Decides a density-control step.
pub fn revise(s: &Situation<'_>, variant: &Variant) -> Revision {
    let preparation =
        Preparation { error: variant.error, fresh_opacity_floor: Some(FRESH_OPACITY_MIN), drops_maps: false };
    let Some(prepared) = preparation.prepare(s) else { return Revision::none(s) };
    let Prepared { scores, pixels, high_error, planned, mut counts, .. } = prepared;
    let mut order: Vec<usize> =
        (0..planned.len()).filter(|&splat| high_error[splat] && planned[splat].is_some()).collect();
    order.sort_by(|&a, &b| scores.error[b].total_cmp(&scores.error[a]).then(a.cmp(&b)));
    let mut plan = Plan::new(planned, s.bound());
    for splat in order {
        grow(s, variant, splat, pixels[splat], &mut plan, &mut counts);
    }
    plan.finish(s.model, counts)
}

/// Splits a splat or refines its map, if the budget allows it.
fn grow(
    s: &Situation<'_>,
    variant: &Variant,
    splat: usize,
    pixel: f64,
    plan: &mut Plan,
    counts: &mut DensityCounts,
) {
    let Some(&planned) = plan.splat(splat) else { return };
    let refined = map::refined(s, variant.moments, &planned);
    let longer_than =
        s.timing.split_texels.filter(|_| s.components.splitting && counts.split < s.timing.max_splits);
    if let Some([first, second]) =
        longer_than.and_then(|texels| split_long(s, Profile::Paper, &planned, pixel, texels))
    {
        // The ceiling of every candidate doubles, also of one that is split.
        let ceiling = refined.map_or(planned.history.ceiling, |refined| refined.history.ceiling);
        let raised = |mut half: PlannedSplat| {
            half.history.ceiling = ceiling;
            half
        };
        if plan.replace(splat, &[raised(first), raised(second)]) {
            counts.split += 1;
            return;
        }
        counts.over_budget += 1;
    }
    if let Some(refined) = refined {
        let is_finer = refined.texels > planned.texels;
        match plan.replace(splat, &[refined]) {
            true => counts.refined += usize::from(is_finer),
            false => counts.over_budget += 1,
        }
    }
}
