//! How the number of tile-splat pairs of a view depends on its splats and on its size.
//!
//! A square box of side s touches (1 + s / tile)^2 tiles on the mean. Boxes of n splats that lie L times over each of t tiles have
//! the side sqrt(L t / n) tiles, so that n splats have (sqrt(n) + sqrt(L t))^2 pairs. The second root is called their **reach**: it
//! grows with the side of the image, and more splats of smaller size have the same.

/// Pairs of visible splats with a reach.
pub fn pairs_of(splats: f64, reach: f64) -> f64 {
    (splats.sqrt() + reach).powi(2)
}

/// The reach of visible splats that have this number of pairs.
pub fn reach_of(splats: f64, pairs: f64) -> f64 {
    (pairs.sqrt() - splats.sqrt()).max(0.0)
}

/// The number of splats with a reach at which a view has this number of pairs.
pub fn splats_of(pairs: f64, reach: f64) -> f64 {
    (pairs.sqrt() - reach).max(0.0).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_of_a_larger_image_are_near_the_counted_ones() {
        // Fox, the same model at two sizes; about 10,000 splats are in a view.
        let reach = reach_of(1e4, 34_069.0) * (1067.0 * 1899.0 / (270.0 * 480.0_f64)).sqrt();
        let ratio = pairs_of(1e4, reach) / 225_000.0;
        // Needed: 0.16.
        assert!((ratio - 1.0).abs() < 0.2, "{ratio}");
        assert!((splats_of(pairs_of(1e4, reach), reach) - 1e4).abs() < 1e-6);
        assert_eq!([reach_of(50.0, 50.0), splats_of(50.0, 10.0)], [0.0; 2]);
    }
}
