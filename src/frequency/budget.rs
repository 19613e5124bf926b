//! How many primitives there should be at a time, rho(t): the count follows the pixels that are
//! trained with (method section 8.5).

use serde::{Deserialize, Serialize};

/// Momentum at the start, in primitives of the start (method section 8.5).
const START_MOMENTUM: f64 = 5.0;

/// What is kept of the momentum from step to step (method section 8.5).
const DECAY: f64 = 0.98;

/// What one step may add to the momentum, in primitives of the start. Published: 10^6, for scenes that
/// start with about 115,000 SfM points; as a multiple it means the same for captures of any size.
const LARGEST_GAIN: f64 = 9.0;

/// Most that one density-control step may add, as a part of what there is (method section 8.5).
const LARGEST_RATE: f64 = 0.2;

/// The target count of primitives and its momentum; part of a run's state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct SplatBudget {
    /// Primitives at the start, P_init.
    pub initial: usize,
    /// M: how many more than at the start there may be in the end. Never falls.
    pub momentum: f64,
}

impl SplatBudget {
    /// The budget of a run that starts with `initial` primitives.
    pub fn new(initial: usize) -> Self {
        Self { initial, momentum: START_MOMENTUM * initial as f64 }
    }

    /// P_max = P_init + M, the count that full-size images are worth.
    pub fn maximum(&self) -> usize {
        (self.initial as f64 + self.momentum).round() as usize
    }

    /// P(t) = P_init + M / r^(2 - t): early in a run the count follows the pixels, later their root.
    /// From one density-control step before T_r on, the caller passes `t = 1`, which gives P_max.
    pub fn target(&self, t: f64, render_scale: f64) -> usize {
        if t >= 1.0 {
            return self.maximum();
        }
        let exponent = 2.0 - t.max(0.0);
        let more = self.momentum / render_scale.max(1.0).powf(exponent);
        (self.initial as f64 + more).round() as usize
    }

    /// Part of `present` primitives that a density-control step may add, 0 to 0.2.
    pub fn rate(&self, present: usize, t: f64, render_scale: f64) -> f64 {
        if present == 0 {
            return 0.0;
        }
        let (target, present) = (self.target(t, render_scale) as f64, present as f64);
        ((target - present) / present).clamp(0.0, LARGEST_RATE)
    }

    /// Takes note of how many primitives a density-control step added: M <- max(M, 0.98 M + added).
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
        // Method section 8.5: 1.31 P_init at r = 4, 2.25 at r = 2, both at the start.
        assert_eq!((budget.target(0.0, 4.0), budget.target(0.0, 2.0)), (1_313, 2_250));
        assert_eq!(
            (budget.target(0.9, 1.0), budget.target(1.0, 4.0), budget.maximum()),
            (6_000, 6_000, 6_000)
        );
        let rising: Vec<usize> = (0..=10).map(|i| budget.target(f64::from(i) / 10.0, 2.0)).collect();
        assert!(rising.windows(2).all(|w| w[0] <= w[1]), "{rising:?}");
    }

    #[test]
    fn rates_stay_within_their_bounds() {
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
