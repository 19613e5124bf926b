//! Growth that is drawn at random, by the error that it is expected to remove per parameter.

use super::candidate::Candidate;
use super::growth::{Growth, Kind};
use super::planned_splat::{PlannedSplat, split_cost};
use super::settings::DensityConfig;
use super::shading::RaiseOffer;
use super::situation::Situation;
use super::split::split_of_any_length;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// The share of a splat's error that an SH band is expected to remove, over the share that a split removes, until both have been
/// measured. Only splats whose highest band matters are offered one.
const BAND_GAIN: f64 = 1.0;

/// Largest share of the splats that one step splits (measured: choices 17; 3DGS-MCMC: 0.05).
pub const SPLIT_RATE: f64 = 0.16;

/// The places of these weights in the order in which they are drawn without replacement, in proportion to them: by the largest
/// keys u^(1/weight) (Efraimidis and Spirakis). Weights are above 0.
pub fn draw_order(weights: impl IntoIterator<Item = f64>, seed: u64) -> Vec<usize> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let key = |(place, weight): (usize, f64)| {
        let u: f64 = rng.random_range(1e-12..1.0);
        (u.ln() / weight, place)
    };
    let mut keys: Vec<(f64, usize)> = weights.into_iter().enumerate().map(key).collect();
    keys.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    keys.into_iter().map(|(_, place)| place).collect()
}

/// An offer to give a splat more parameters.
pub struct Offer {
    /// Index of the splat.
    pub splat: usize,
    /// Kind of growth.
    pub kind: Kind,
    /// What the splat becomes with a refined map or another SH band; `None`: it is split.
    pub grown: Option<PlannedSplat>,
    /// The error that it is expected to remove per parameter, in any unit.
    pub weight: f64,
}

/// Raises the ceilings of candidates whose maps cannot be refined yet, which costs nothing.
pub fn raise_ceilings(planned_splats: &mut [Option<PlannedSplat>], candidates: &[Candidate]) {
    for candidate in candidates.iter().filter(|candidate| candidate.refined_cost.is_none()) {
        let planned = &mut planned_splats[candidate.splat];
        *planned = candidate.refined.or(*planned);
    }
}

/// All offers of a step that remove error: any splat may be split unless its map is coarsened, since halves take their parts of
/// the map as it is.
pub fn offers(
    s: &Situation<'_>,
    config: &DensityConfig,
    planned_splats: &[Option<PlannedSplat>],
    errors: &[f64],
    candidates: &[Candidate],
    bands: &[RaiseOffer],
    growth: &Growth,
) -> Vec<Offer> {
    let params = |planned: &PlannedSplat| planned.params() as f64;
    let may_split = |planned: &&PlannedSplat| !planned.change.is_coarser();
    let texel_gain = growth.gain(Kind::Refined, config.texel_gain);
    let band_gain = growth.gain(Kind::Band, BAND_GAIN);
    let split = |planned: &PlannedSplat| {
        let pair = split_of_any_length(s, config, planned, config.split_profile);
        let splat = planned.source as usize;
        Offer { splat, kind: Kind::Split, grown: None, weight: errors[splat] / split_cost(planned, &pair) }
    };
    let refined = |candidate: &Candidate| {
        let (grown, cost) = (candidate.refined, candidate.refined_cost?);
        let weight = texel_gain * candidate.error / cost;
        Some(Offer { splat: candidate.splat, kind: Kind::Refined, grown, weight })
    };
    let raised = |offer: &RaiseOffer| {
        let splat = offer.source as usize;
        let planned = planned_splats[splat].as_ref()?;
        let grown = offer.raised(planned);
        let weight = band_gain * errors[splat] / (params(&grown) - params(planned));
        Some(Offer { splat, kind: Kind::Band, grown: Some(grown), weight })
    };
    let splits = planned_splats.iter().flatten().filter(may_split).map(split);
    let all = splits.chain(candidates.iter().filter_map(refined)).chain(bands.iter().filter_map(raised));
    all.filter(|offer| offer.weight > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offers_are_drawn_in_proportion_to_their_weights() {
        let weights = [1.0, 1e-9, 3.0];
        let first = |place: usize| {
            (0..4000).filter(|&seed| draw_order(weights, seed)[0] == place).count() as f64 / 4000.0
        };
        // Standard deviation 0.007.
        assert!(
            (first(0) - 0.25).abs() < 0.03 && (first(2) - 0.75).abs() < 0.03,
            "{} {}",
            first(0),
            first(2)
        );
        assert_eq!(draw_order(weights, 7).len(), 3);
    }
}
