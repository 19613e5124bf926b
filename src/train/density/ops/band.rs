//! SH degrees of splats: bands that hardly change a splat's colour are dropped, and splats whose highest band matters may gain
//! another (method 6.13).

use crate::constants::sh_coefficients;
use crate::train::density::history::SplatHistory;
use crate::train::density::plan::PlannedSplat;
use crate::train::density::settings::DensityConfig;
use crate::train::density::situation::{DensityCounts, Situation};
use crate::train::density::stats::Scores;

/// Floats of the SH coefficients of degree 1.
const FIRST_BAND_FLOATS: f64 = 9.0;

/// The splat with another band.
pub fn gained(planned: &PlannedSplat) -> PlannedSplat {
    let history = SplatHistory { band_checks: 0, ..planned.history };
    PlannedSplat { sh_degree: planned.sh_degree + 1, history, ..*planned }
}

/// Drops the highest bands of a splat that save less squared error per float than [`DensityConfig::sh_below`] asks for. Returns
/// what its highest band saves per float if it may gain another. Bands above [`Timing::sh_tested`], or gained in the last
/// [`Timing::sh_trial_checks`], are too young to be tested, and stay if the highest one below them does. A splat that no view of
/// the window saw keeps all.
///
/// [`DensityConfig::sh_below`]: crate::train::density::DensityConfig::sh_below
/// [`Timing::sh_tested`]: crate::train::density::situation::Timing::sh_tested
/// [`Timing::sh_trial_checks`]: crate::train::density::situation::Timing::sh_trial_checks
pub fn test(
    s: &Situation<'_>,
    scores: &Scores,
    planned: &mut PlannedSplat,
    counts: &mut DensityCounts,
) -> Option<f64> {
    let (splat, timing) = (planned.source as usize, &s.timing);
    let DensityConfig { sh_below, sh_raise, .. } = *s.settings;
    if sh_below <= 0.0 || !timing.use_statistics {
        return None;
    }
    let history = &mut planned.history;
    history.band_checks = history.band_checks.saturating_add(1);
    if !timing.may_coarsen || !scores.seen[splat] {
        return None;
    }
    let (held, sh) = (planned.sh_degree, s.model.splats.sh_of(splat));
    let is_young = history.band_checks < timing.sh_trial_checks;
    let tested = (held - u8::from(is_young && held > 0)).min(timing.sh_tested as u8);
    // The squared error that the bands above a degree save, per float.
    let saved = |degree: u8| {
        let first = 3 * sh_coefficients(degree.into());
        scores.share[splat] * change(&sh[first..]).powi(2) / (sh.len() - first) as f64
    };
    let least = |change: f64| change.powi(2) / FIRST_BAND_FLOATS;
    let mut kept = tested;
    while kept > 0 && saved(kept - 1) < least(sh_below) {
        kept -= 1;
    }
    if kept < tested {
        planned.sh_degree = kept;
        (history.band_checks, history.bands_settled) = (u16::MAX, true);
        counts.bands_lost += 1;
        return None;
    }
    let may_gain =
        tested == held && held > 0 && u32::from(held) < timing.sh_highest && !history.bands_settled;
    may_gain.then(|| saved(held - 1)).filter(|&saved| sh_raise > 0.0 && saved >= least(sh_raise))
}

/// Root mean square over directions and channels of what these coefficients add to the colour. The basis is orthonormal
/// on the sphere.
fn change(sh: &[f32]) -> f64 {
    let squares: f64 = sh.iter().map(|&c| f64::from(c).powi(2)).sum();
    (squares / (3.0 * 4.0 * std::f64::consts::PI)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::SH_0;

    #[test]
    fn the_change_is_in_units_of_colour() {
        // Degree 0 alone: a constant colour.
        let sh = [0.2, 0.2, 0.2].map(|v| (v / SH_0) as f32);
        assert!((change(&sh) - 0.2).abs() < 1e-6, "{}", change(&sh));
    }
}
