//! Target number of splats: it follows the number of pixels in training (method 7.5).

use serde::{Deserialize, Serialize};

/// Initial momentum as a multiple of the initial splats (DashGaussian).
const START_MOMENTUM: f64 = 5.0;

/// Factor of the momentum per density-control step (DashGaussian).
const DECAY: f64 = 0.98;

/// Largest gain of momentum per step as a multiple of the initial splats. Published: 10^6, for scenes that
/// start from about 115,000 SfM points; as a multiple it means the same for captures of any size.
const LARGEST_GAIN: f64 = 9.0;

/// Largest share of splats that a density-control step may add (DashGaussian).
const LARGEST_RATE: f64 = 0.2;

/// Target number of splats and its momentum; part of a run's state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SplatBudget {
    /// Splats at initialisation, P_0.
    pub initial: usize,
    /// M: how many splats more than P_0 the final model may have. Never falls.
    pub momentum: f64,
}

impl SplatBudget {
    /// The target of a run that starts with `initial` splats.
    pub fn new(initial: usize) -> Self {
        Self { initial, momentum: START_MOMENTUM * initial as f64 }
    }

    /// P_max = P_0 + M, the number of splats for images of full size.
    pub fn maximum(&self) -> usize {
        (self.initial as f64 + self.momentum).round() as usize
    }

    /// P(t) = P_0 + M / r^(2 - t): early in a run the number follows the pixels, later their square root.
    /// From one density-control step before T_r on, the caller passes `t = 1`, which gives P_max.
    pub fn target(&self, t: f64, render_scale: f64) -> usize {
        if t >= 1.0 {
            return self.maximum();
        }
        let exponent = 2.0 - t.max(0.0);
        let more = self.momentum / render_scale.max(1.0).powf(exponent);
        (self.initial as f64 + more).round() as usize
    }

    /// Share of the `current` splats that a density-control step may add, 0 to 0.2.
    pub fn rate(&self, current: usize, t: f64, render_scale: f64) -> f64 {
        if current == 0 {
            return 0.0;
        }
        let (target, current) = (self.target(t, render_scale) as f64, current as f64);
        ((target - current) / current).clamp(0.0, LARGEST_RATE)
    }

    /// Updates the momentum by the splats that a density-control step added: M <- max(M, 0.98 M + added).
    pub fn observe(&mut self, added: usize) {
        let gain = (added as f64).min(LARGEST_GAIN * self.initial as f64);
        self.momentum = self.momentum.max(DECAY * self.momentum + gain);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_follow_pixels_early_and_reach_the_maximum() {
        let budget = SplatBudget::new(1_000);
        // By the formula, 1.31 P_0 at r = 4 and 2.25 P_0 at r = 2, both at t = 0.
        assert_eq!((budget.target(0.0, 4.0), budget.target(0.0, 2.0)), (1_313, 2_250));
        assert_eq!(
            (budget.target(0.9, 1.0), budget.target(1.0, 4.0), budget.maximum()),
            (6_000, 6_000, 6_000)
        );
        let rising: Vec<usize> = (0..=10).map(|i| budget.target(f64::from(i) / 10.0, 2.0)).collect();
        assert!(rising.windows(2).all(|w| w[0] <= w[1]), "{rising:?}");
    }

    #[test]
    fn rates_are_between_0_and_20_percent() {
        let budget = SplatBudget::new(1_000);
        assert_eq!(budget.rate(1_000, 0.0, 1.0), 0.2);
        assert_eq!(budget.rate(7_000, 0.0, 1.0), 0.0);
        assert!((budget.rate(2_000, 0.0, 2.0) - 0.125).abs() < 1e-12);
        assert_eq!(budget.rate(0, 0.5, 1.0), 0.0);
        assert_eq!(SplatBudget::new(0).rate(5, 0.5, 1.0), 0.0);
    }

    #[test]
    fn momentum_never_falls_and_gains_are_bounded() {
        let mut budget = SplatBudget::new(1_000);
        budget.observe(0);
        assert_eq!(budget.momentum, 5_000.0);
        budget.observe(200);
        assert!((budget.momentum - 5_100.0).abs() < 1e-9);
        budget.observe(usize::MAX);
        assert!((budget.momentum - (0.98 * 5_100.0 + 9_000.0)).abs() < 1e-9);
    }
}
