//! SH degrees of splats: bands that hardly change a splat's colour are given back (method 6.13).

use super::score::Scores;
use super::settings::DensityConfig;
use super::situation::{DensityCounts, Situation};
use crate::constants::sh_coefficients;

/// Floats of the SH coefficients of degree 1.
const FIRST_BAND_FLOATS: f64 = 9.0;

/// The SH degree that a splat keeps, without the highest bands that are worth less per float than
/// [`DensityConfig::sh_below`] asks for. Bands above [`Situation::sh_tested`] are too young to be judged, and stay if the
/// highest one below them does. A splat that no view of the window saw keeps all.
pub fn kept_degree(
    s: &Situation<'_>,
    config: &DensityConfig,
    scores: &Scores,
    splat: usize,
    counts: &mut DensityCounts,
) -> u8 {
    let splats = &s.model.splats;
    let held = splats.sh_degrees()[splat];
    if config.sh_below <= 0.0 || !s.use_statistics || !s.may_coarsen || !scores.seen[splat] {
        return held;
    }
    let sh = splats.sh_of(splat);
    let tested = held.min(s.sh_tested as u8);
    let mut kept = tested;
    while kept > 0 {
        let [below, all] = [kept - 1, held].map(|degree| 3 * sh_coefficients(degree.into()));
        // The squared error that the bands save, per float.
        let worth = scores.share[splat] * change(&sh[below..all]).powi(2) / (all - below) as f64;
        if worth >= config.sh_below.powi(2) / FIRST_BAND_FLOATS {
            break;
        }
        kept -= 1;
    }
    if kept == tested {
        return held;
    }
    counts.shaded_less += 1;
    kept
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
