//! Growth of `litetex`, and of the policies that differ from it only in their maps (method 6.6): all that a splat could become,
//! split, with a finer map or another SH band, is drawn by the error that it is expected to remove per parameter.

use super::prepare::{Preparation, Prepared, SPLATS_PER_TASK};
use super::spec::{RuleSpec, SPLIT_RATE, SplitShare};
use crate::train::density::draw::draw_order;
use crate::train::density::ops::band;
use crate::train::density::ops::map::{self, Moments};
use crate::train::density::ops::split::{Profile, split_any, split_long};
use crate::train::density::plan::{Plan, PlannedSplat, cost};
use crate::train::density::settings::Budget;
use crate::train::density::situation::{DensityCounts, Revision, Situation};
use crate::train::density::stats::ErrorMeasure;
use rayon::prelude::*;

/// The share of a splat's error that its first map is expected to remove, that a finer one is, and that another SH band is, over
/// the share that a split removes (method 6.6).
const FIRST_MAP_GAIN: f64 = 1.0;
const REFINED_GAIN: f64 = 0.25;
const BAND_GAIN: f64 = 1.0;

/// Length in finest texels above which a splat may be split to replace a pruned one. Not measured.
const RESPAWN_TEXELS: f64 = 2.0;

/// Weight of such splits over that of others: they come last.
const RESPAWN_WEIGHT: f64 = 1e-6;

/// An offer: what a splat could become.
struct Offer {
    /// Index of the splat.
    splat: usize,
    kind: Kind,
    /// The splat with a finer map or another band, or its halves.
    parts: Vec<PlannedSplat>,
    /// In proportion to the error that it is expected to remove per parameter.
    weight: f64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Split,
    /// A split of a splat that is too short for others, to replace a pruned one.
    Respawn,
    FirstMap,
    Refined,
    Band,
}

impl Kind {
    /// The share of a splat's error that it removes, over the share that a split removes.
    fn gain(self) -> f64 {
        match self {
            Self::Split => 1.0,
            Self::Respawn => RESPAWN_WEIGHT,
            Self::FirstMap => FIRST_MAP_GAIN,
            Self::Refined => REFINED_GAIN,
            Self::Band => BAND_GAIN,
        }
    }
}

/// With a budget of parameters, splats of any length are split as often as those of `plain`. Without one, growth follows the
/// length of splats (method 6.8). `fewest` are the steps of the shortest interval.
pub fn spec(budget: &Budget, fewest: u32) -> RuleSpec {
    let without_budget = RuleSpec {
        unused: &[],
        interval: 250,
        epoch: [fewest, 50],
        split_share: SplitShare::Scheduled,
        splits_any_length: false,
        is_paced: false,
        ends_by_need: true,
        crops_between: false,
    };
    match budget.max_params {
        None => without_budget,
        Some(_) => RuleSpec {
            interval: 100,
            epoch: [fewest.div_ceil(2), 25],
            split_share: SplitShare::Fixed(SPLIT_RATE),
            splits_any_length: true,
            ..without_budget
        },
    }
}

/// Decides a density-control step.
pub fn revise(s: &Situation<'_>) -> Revision {
    let preparation = Preparation { error: ErrorMeasure::Mass, fresh_opacity_floor: None, drops_maps: true };
    let Some(mut prepared) = preparation.prepare(s) else { return Revision::none(s) };
    let offers = if s.timing.grows { all_offers(s, &mut prepared) } else { Vec::new() };
    let Prepared { planned, mut counts, .. } = prepared;
    let mut plan = Plan::new(planned, s.bound());
    take(s, &offers, &mut plan, &mut counts);
    plan.finish(s.model, counts)
}

/// What all splats could become, without what is expected to gain nothing.
fn all_offers(s: &Situation<'_>, prepared: &mut Prepared) -> Vec<Offer> {
    let Prepared { scores, pixels, high_error, may_gain_band, planned, .. } = prepared;
    let of_splat = |planned: &mut Option<PlannedSplat>| {
        let Some(planned) = planned else { return Vec::new() };
        let splat = planned.source as usize;
        let found = offers_of(s, planned, high_error[splat], may_gain_band[splat], pixels[splat]);
        let offer = |(kind, parts): (Kind, Vec<PlannedSplat>)| {
            let weight = kind.gain() * scores.error[splat] / cost(&s.charge, planned, &parts);
            Offer { splat, kind, parts, weight }
        };
        found.into_iter().map(offer).filter(|offer| offer.weight > 0.0).collect()
    };
    planned.par_iter_mut().with_min_len(SPLATS_PER_TASK).flat_map_iter(of_splat).collect()
}

/// What a splat could become. The ceiling of a map that cannot be refined yet is raised, which costs nothing.
fn offers_of(
    s: &Situation<'_>,
    planned: &mut PlannedSplat,
    is_high_error: bool,
    may_gain_band: bool,
    pixel: f64,
) -> Vec<(Kind, Vec<PlannedSplat>)> {
    let mut offers = Vec::new();
    if let Some(refined) = is_high_error.then(|| map::refined(s, Moments::Scaled, planned)).flatten() {
        let kind = if planned.texels == 0 { Kind::FirstMap } else { Kind::Refined };
        match refined.texels > planned.texels {
            true => offers.push((kind, vec![refined])),
            false => *planned = refined,
        }
    }
    if may_gain_band {
        offers.push((Kind::Band, vec![band::gained(planned)]));
    }
    // Halves take their parts of the map as it is.
    if s.components.splitting && !planned.change.is_coarser() {
        let long = |texels| split_long(s, Profile::Tight, planned, pixel, texels);
        let split = match s.timing.split_texels {
            None => Some((Kind::Split, split_any(s, Profile::Tight, planned))),
            Some(_) if !is_high_error => None,
            Some(texels) => {
                let short = || long(RESPAWN_TEXELS).map(|halves| (Kind::Respawn, halves));
                long(texels).map(|halves| (Kind::Split, halves)).or_else(short)
            }
        };
        offers.extend(split.map(|(kind, halves)| (kind, halves.to_vec())));
    }
    offers
}

/// Takes offers as they are drawn, at most one for a splat, as far as budget and timetable allow.
fn take(s: &Situation<'_>, offers: &[Offer], plan: &mut Plan, counts: &mut DensityCounts) {
    let mut is_served = vec![false; s.model.num_splats()];
    let mut is_refused = is_served.clone();
    for place in draw_order(offers.iter().map(|offer| offer.weight), s.seed) {
        let Offer { splat, kind, ref parts, .. } = offers[place];
        let may_split = counts.split + counts.respawned < s.timing.max_splits;
        let has_room = match kind {
            Kind::Split => may_split,
            Kind::Respawn => may_split && plan.num_splats() < s.initial_splats,
            Kind::FirstMap | Kind::Refined | Kind::Band => true,
        };
        if is_served[splat] || !has_room {
            continue;
        }
        if !plan.replace(splat, parts) {
            is_refused[splat] = true;
            continue;
        }
        is_served[splat] = true;
        *match kind {
            Kind::Split => &mut counts.split,
            Kind::Respawn => &mut counts.respawned,
            Kind::FirstMap | Kind::Refined => &mut counts.refined,
            Kind::Band => &mut counts.bands_gained,
        } += 1;
    }
    counts.over_budget +=
        (0..is_served.len()).filter(|&splat| is_refused[splat] && !is_served[splat]).count();
}
