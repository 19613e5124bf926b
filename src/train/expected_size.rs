//! How many splats a model is expected to have as its training goes on, for the time that the steps will take.

use super::config::TrainConfig;
use super::density::SplitShare;
use super::schedule::Schedule;

/// Growth shows between these shares of a run (four captures, 1,000 steps, and fox, 5,000 steps, within 300,000 parameters:
/// constant to 0.25, when SH bands are pruned, nearly all of it by 0.3 to 0.35).
const GROWTH: [f64; 2] = [0.25, 0.35];
/// Share at which models are pruned.
const PRUNED: f64 = 0.8;

/// Parameters per splat where growth exceeds its budget, and where pruning has met it. Measured within 300,000 parameters: fox,
/// flower, bonsai and lego with `litetex` 33, 31, 29 and 42, then 22, 18, 21 and 28; fox with `plain` 31, then 18; within 150,000, fox
/// and flower 21 and 20, then 16 and 14.
const PARAMS_EACH_GROWN: f64 = 34.0;
const PARAMS_EACH_PRUNED: f64 = 20.0;

/// Without a budget splats are split until each has about this many pixels of a view, as fast as the steps allow. Measured
/// steps and pixels for each initial splat, then splats over those at the start: fox 600, 137: 1.38;
/// 1,646, 9: 1.06; 1,933, 35: 1.40; 2,584, 97: 2.82; 7,326, 97: 3.11; flower 2,072 and 6,935, 18: 0.9; bonsai 1,677, 24: 1.02;
/// 5,853, 24: 1.22; lego 10,228, 29: 1.00; 30,000, 29: 1.12.
const PIXELS_EACH_GROWN: f64 = 32.0;
/// Steps in which a model grows by as many splats as it started with.
const STEPS_TO_DOUBLE: f64 = 1_400.0;

/// The course of the number of splats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedSize {
    initial: f64,
    grown: f64,
    pruned: f64,
}

impl ExpectedSize {
    /// For a run that starts with `initial` splats, on views of this many pixels.
    pub fn new(config: &TrainConfig, schedule: &Schedule, initial: usize, pixels: f64) -> Self {
        let initial = initial.max(1) as f64;
        let free = (pixels / PIXELS_EACH_GROWN).max(initial);
        let bounded = |params: Option<usize>, each: f64| params.map(|params| params as f64 / each);
        let grown = match (
            config.rule().split_share,
            bounded(schedule.budget(config, 0).max_params, PARAMS_EACH_GROWN),
        ) {
            (SplitShare::Fixed(0.0), _) => initial,
            (_, Some(grown)) => grown.max(initial),
            (SplitShare::Fixed(_), None) => initial,
            (SplitShare::Scheduled, None) => {
                free.min(initial * (1.0 + f64::from(config.steps) / STEPS_TO_DOUBLE))
            }
        };
        let grown = grown.min(config.budget.max_splats.map_or(f64::INFINITY, |most| most as f64));
        let pruned = match schedule.prune_rounds {
            0 => grown,
            _ => bounded(config.most_params(), PARAMS_EACH_PRUNED).map_or(grown, |pruned| pruned.min(grown)),
        };
        Self { initial, grown, pruned }
    }

    /// Splats at the start.
    pub fn initial(&self) -> f64 {
        self.initial
    }

    /// Splats at a share of the run of which a model has `now` at the share `then`.
    pub fn splats(&self, share: f64, (then, now): (f64, f64)) -> f64 {
        if then >= PRUNED {
            return now;
        }
        if share >= PRUNED {
            return self.pruned;
        }
        let grown = |share: f64| {
            let part = ((share - GROWTH[0]) / (GROWTH[1] - GROWTH[0])).clamp(0.0, 1.0);
            self.initial + part * (self.grown - self.initial)
        };
        (now + (grown(share) - grown(then))).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::density::Budget;

    #[test]
    fn models_grow_beyond_their_budget_and_are_pruned_to_it() {
        let budget = Budget { max_params: Some(300_000), ..Budget::default() };
        let config = TrainConfig { steps: 1_000, budget, ..TrainConfig::default() };
        let size = ExpectedSize::new(&config, &Schedule::new(&config, 43), 15_000, 129_600.0);
        let of = |share| size.splats(share, (0.0, 15_000.0));
        // Measured on fox: 18,192, 22,606 and 13,545.
        assert_eq!(of(0.1), 15_000.0);
        assert!((of(0.5) / 22_606.0 - 1.0).abs() < 0.1 && (of(0.9) / 13_545.0 - 1.0).abs() < 0.2, "{size:?}");
        // What is known counts.
        assert_eq!(size.splats(0.6, (0.5, 25_000.0)), 25_000.0);
        assert_eq!(size.splats(0.95, (0.9, 9_000.0)), 9_000.0);
    }

    #[test]
    fn without_a_budget_models_grow_where_splats_are_large() {
        // Measured: fox at 1600 pixels, 41,700 splats after 2,584 steps; at 480 pixels, 15,600 after 1,646.
        let splats = |steps, pixels| {
            let config = TrainConfig { steps, ..TrainConfig::default() };
            ExpectedSize::new(&config, &Schedule::new(&config, 43), 14_771, pixels)
                .splats(0.7, (0.0, 14_771.0))
        };
        assert!((splats(2_584, 1_438_400.0) / 41_700.0 - 1.0).abs() < 0.1, "{}", splats(2_584, 1_438_400.0));
        assert_eq!(splats(1_646, 129_600.0), 14_771.0);
        // Fewer steps leave no time to grow.
        assert!(splats(600, 2_026_233.0) < 22_000.0, "{}", splats(600, 2_026_233.0));
    }
}
