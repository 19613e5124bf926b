//! SH degrees of splats: bands that hardly change a splat's colour are given back, and splats whose highest band matters gain
//! another (method 6.13).

use super::history::SplatHistory;
use super::planned_splat::{PlannedSplat, size_of, with, without};
use super::score::Scores;
use super::settings::{Budget, DensityConfig};
use super::situation::{DensityCounts, Situation};
use crate::constants::sh_coefficients;

/// Floats of the SH coefficients of degree 1.
const FIRST_BAND_FLOATS: f64 = 9.0;

/// The offer to give a splat another band.
#[derive(Clone, Copy, Debug)]
pub struct RaiseOffer {
    /// Index of the splat in the old model.
    pub source: u32,
    /// Squared error that its highest band saves, per float.
    worth: f64,
}

impl RaiseOffer {
    /// The splat with another band.
    pub fn raised(&self, planned: &PlannedSplat) -> PlannedSplat {
        let history = SplatHistory { band_checks: 0, ..planned.history };
        PlannedSplat { sh_degree: planned.sh_degree + 1, history, ..*planned }
    }
}

/// Takes from a splat the highest bands that are worth less per float than [`DensityConfig::sh_below`] asks for, or offers to
/// give it another. Bands above [`Situation::sh_tested`], or gained in the last [`Situation::sh_trial_checks`], are too young to
/// be judged, and stay if the highest one below them does. A splat that no view of the window saw keeps all.
pub fn shade(
    s: &Situation<'_>,
    config: &DensityConfig,
    scores: &Scores,
    planned: &mut PlannedSplat,
    counts: &mut DensityCounts,
) -> Option<RaiseOffer> {
    let splat = planned.source as usize;
    if config.sh_below <= 0.0 || !s.use_statistics {
        return None;
    }
    let history = &mut planned.history;
    history.band_checks = history.band_checks.saturating_add(1);
    if !s.may_coarsen || !scores.seen[splat] {
        return None;
    }
    let (held, sh) = (planned.sh_degree, s.model.splats.sh_of(splat));
    let is_young = history.band_checks < s.sh_trial_checks;
    let tested = (held - u8::from(is_young && held > 0)).min(s.sh_tested as u8);
    // The squared error that the bands above a degree save, per float.
    let worth = |degree: u8| {
        let first = 3 * sh_coefficients(degree.into());
        scores.share[splat] * change(&sh[first..]).powi(2) / (sh.len() - first) as f64
    };
    let least = |change: f64| change.powi(2) / FIRST_BAND_FLOATS;
    let mut kept = tested;
    while kept > 0 && worth(kept - 1) < least(config.sh_below) {
        kept -= 1;
    }
    if kept < tested {
        planned.sh_degree = kept;
        (history.band_checks, history.bands_settled) = (u16::MAX, true);
        counts.shaded_less += 1;
        return None;
    }
    let may_gain = tested == held && held > 0 && u32::from(held) < s.sh_highest && !history.bands_settled;
    let offer = may_gain.then(|| RaiseOffer { source: planned.source, worth: worth(held - 1) })?;
    (config.sh_raise > 0.0 && offer.worth >= least(config.sh_raise)).then_some(offer)
}

/// Gives splats another band, the best offers first, as far as the budget allows.
pub fn raise<'a>(
    offers: &mut [RaiseOffer],
    planned_splats: impl IntoIterator<Item = &'a mut PlannedSplat>,
    budget: Option<&Budget>,
    counts: &mut DensityCounts,
) {
    let mut planned_splats: Vec<&mut PlannedSplat> = planned_splats.into_iter().collect();
    let mut size = size_of(planned_splats.iter().map(|planned| &**planned));
    offers.sort_by(|a, b| b.worth.total_cmp(&a.worth).then(a.source.cmp(&b.source)));
    for offer in offers {
        // Planned splats are still in the order of their sources.
        let Ok(at) = planned_splats.binary_search_by_key(&offer.source, |planned| planned.source) else {
            continue;
        };
        let raised = offer.raised(planned_splats[at]);
        let grown = with(without(size, planned_splats[at]), &raised);
        if budget.is_none_or(|budget| budget.allows(&grown)) {
            size = grown;
            *planned_splats[at] = raised;
            counts.shaded_more += 1;
        }
    }
}

/// Root mean square over directions and channels of what these coefficients add to the colour. The basis is orthonormal
/// on the sphere.
fn change(sh: &[f32]) -> f64 {
    let squares: f64 = sh.iter().map(|&c| f64::from(c).powi(2)).sum();
    (squares / (3.0 * 4.0 * std::f64::consts::PI)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::sizes::Sizes;
    use super::*;
    use crate::backend::MapChange;
    use crate::constants::SH_0;

    #[test]
    fn the_best_offers_come_first_as_far_as_the_budget_goes() {
        let raised = |most: usize| {
            let budget = Budget { max_params: Some(most), ..Budget::default() };
            let planned = |source| PlannedSplat {
                source,
                change: MapChange::Keep,
                edit: None,
                history: SplatHistory::first(2),
                sizes: Sizes::default(),
                texels: 0,
                sh_degree: 1,
            };
            // Splat 1 was pruned.
            let mut splats = [0, 2, 3].map(planned);
            let offer = |(source, worth)| RaiseOffer { source, worth };
            let mut offers = [(0, 1.0), (1, 9.0), (2, 3.0), (3, 2.0)].map(offer).to_vec();
            let mut counts = DensityCounts::default();
            raise(&mut offers, &mut splats, Some(&budget), &mut counts);
            assert_eq!(counts.shaded_more, splats.iter().filter(|splat| splat.sh_degree == 2).count());
            splats.map(|splat| splat.sh_degree)
        };
        // 22 parameters at degree 1, and 15 for the next band.
        let now = 3 * 22;
        assert_eq!(raised(now + 14), [1, 1, 1]);
        assert_eq!(raised(now + 15), [1, 2, 1]);
        assert_eq!(raised(now + 44), [1, 2, 2]);
        assert_eq!(raised(now + 45), [2, 2, 2]);
    }

    #[test]
    fn the_change_is_in_units_of_colour() {
        // Degree 0 alone: a constant colour.
        let sh = [0.2, 0.2, 0.2].map(|v| (v / SH_0) as f32);
        assert!((change(&sh) - 0.2).abs() < 1e-6, "{}", change(&sh));
    }
}
