//! Drawing without replacement in proportion to weights.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_drawn_in_proportion_to_their_weights() {
        let weights = [1.0, 1e-9, 3.0];
        let first = |place: usize| {
            (0..4000).filter(|&seed| draw_order(weights, seed)[0] == place).count() as f64 / 4000.0
        };
        // Standard deviation 0.007.
        let [small, large] = [first(0), first(2)];
        assert!((small - 0.25).abs() < 0.03 && (large - 0.75).abs() < 0.03, "{small} {large}");
        assert_eq!(draw_order(weights, 7).len(), 3);
    }
}
