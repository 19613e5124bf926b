//! Splats drawn at random by the error that they carry.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// These splats in the order in which they are drawn without replacement, in proportion to their errors: by the largest keys
/// u^(1/error) (Efraimidis and Spirakis).
pub fn draw_order(splats: impl IntoIterator<Item = usize>, errors: &[f64], seed: u64) -> Vec<usize> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let key = |splat: usize| {
        let u: f64 = rng.random_range(1e-12..1.0);
        (u.ln() / errors[splat].max(1e-30), splat)
    };
    let mut keys: Vec<(f64, usize)> = splats.into_iter().map(key).collect();
    keys.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    keys.into_iter().map(|(_, splat)| splat).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splats_are_drawn_in_proportion_to_their_errors() {
        let errors = [1.0, 0.0, 3.0, 100.0];
        let first = |splat: usize| {
            (0..4000).filter(|&seed| draw_order([0, 1, 2], &errors, seed)[0] == splat).count() as f64 / 4000.0
        };
        // Standard deviation 0.007; splat 3 is not among those drawn.
        assert!(
            (first(0) - 0.25).abs() < 0.03 && (first(2) - 0.75).abs() < 0.03,
            "{} {}",
            first(0),
            first(2)
        );
        assert_eq!(draw_order([2, 0], &errors, 7).len(), 2);
    }
}
