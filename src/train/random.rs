//! Streams of random numbers of a training run: one for each purpose and step, all from the run's seed. Draws for one
//! purpose do not shift those for another, and a resumed run draws what an uninterrupted one would. (The initial model has
//! streams of its own, in `init::random`.)

use rand::SeedableRng as _;
use rand_pcg::Pcg64Mcg;

/// 2^64 over the golden ratio, which spreads consecutive numbers over all bits.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// What a stream is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RandomStream {
    /// The order of the views of an epoch.
    ViewOrder,
    /// The background of a step.
    Background,
    /// What a density-control step draws.
    Growth,
    /// What a round of pruning draws.
    Pruning,
}

impl RandomStream {
    /// Seed of the stream for a step, or for an epoch.
    pub fn seed(self, run_seed: u64, number: u32) -> u64 {
        // What sets a purpose apart: the upper half of the number that is spread, and the factor that spreads it.
        let (purpose, factor) = match self {
            Self::ViewOrder => (0x7669_6577, GOLDEN),
            Self::Background => (0, 0xD1B5_4A32_D192_ED03),
            Self::Growth => (0, GOLDEN),
            Self::Pruning => (0x7072_756E, GOLDEN),
        };
        run_seed ^ (purpose << 32 | u64::from(number)).wrapping_mul(factor)
    }

    /// The stream for a step, or for an epoch.
    pub fn at(self, run_seed: u64, number: u32) -> Pcg64Mcg {
        Pcg64Mcg::seed_from_u64(self.seed(run_seed, number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use RandomStream::{Background, Growth, Pruning, ViewOrder};

    #[test]
    fn streams_differ_by_purpose_number_and_seed() {
        let mut seeds = Vec::new();
        for stream in [ViewOrder, Background, Growth, Pruning] {
            for (run_seed, number) in [(42, 1), (42, 2), (43, 1)] {
                seeds.push(stream.seed(run_seed, number));
            }
        }
        // At number 0 without a purpose the seed is that of the run.
        assert_eq!(Background.seed(42, 0), 42);
        let num_seeds = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), num_seeds);
    }

    #[test]
    fn seeds_stay_those_of_recorded_runs() {
        // Of the code that the recorded runs were trained with.
        assert_eq!(ViewOrder.seed(42, 3), 0xFBD7_63EF_7DDF_7415);
        assert_eq!(Background.seed(42, 2), 0xA36A_9465_A325_DA2C);
    }
}
