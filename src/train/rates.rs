//! How learning rates change in a run (method 4.2).

use super::config::TrainConfig;
use super::schedule::{PUBLISHED_STEPS, Schedule};
use crate::backend::LearningRates;

/// Most times that a run may be shorter than the published one for its rates: runs below 470 steps have those of 470 (measured at 300
/// steps: lab/choices.md 28).
const MOST_MISSING: f64 = 64.0;

/// Share of a run after which rates fall.
const FALL_START: f64 = 2.0 / 3.0;

impl Schedule {
    /// Learning rates of a step; steps count from 1.
    ///
    /// The published rates are made for 30,000 steps; with Adam, a run of a tenth of them cannot travel far enough. So rates rise
    /// with a power of the missing length: [`raise`](super::RateConfig::raise); a quarter less for log-scales and SH degree 0, a half less for
    /// opacity. High rates make noise, so all fall at the end (method 4.2).
    pub fn rates(&self, config: &TrainConfig, step: u32) -> LearningRates {
        let r = &config.rates;
        let done = self.original_steps(step - 1);
        let t = (done / f64::from(self.position_end)).min(1.0);
        let (start, end) = (f64::from(r.position).ln(), f64::from(r.position_end).ln());
        let missing = (PUBLISHED_STEPS / f64::from(config.steps)).clamp(1.0, MOST_MISSING);
        let gone = (done / f64::from(config.steps) - FALL_START) / (1.0 - FALL_START);
        let calm = self.rounding.map_or(1.0, |phase| phase.rates(step));
        let fall = r.fall.powf(gone.clamp(0.0, 1.0)) * f64::from(calm);
        let [fast, slow, slowest] =
            [0.0, 0.25, 0.5].map(|less| (missing.powf((r.raise - less).max(0.0)) * fall) as f32);
        LearningRates {
            position: fast * (start + (end - start) * t).exp() as f32,
            quaternion: fast * r.quaternion,
            log_scale: slow * r.log_scale,
            opacity: slowest * r.opacity,
            sh_dc: slow * r.sh_dc,
            sh_rest: fast * r.sh_rest,
            texel: if step >= self.texture_start { fast * r.texel } else { 0.0 },
            texel_growth: if config.active_components().update_rule { r.texel_growth } else { 0.0 },
            texel_growth_limit: r.texel_growth_limit,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::RateConfig;
    use super::*;

    /// Rates of a run of this length at its first, its middle and its last step.
    fn rates(steps: u32, rates: RateConfig) -> [LearningRates; 3] {
        let config = TrainConfig { steps, rates, ..TrainConfig::default() };
        let schedule = Schedule::new(&config, 300);
        [1, steps / 2, steps].map(|step| schedule.rates(&config, step))
    }

    fn ratio(a: f32, b: f32) -> f32 {
        (a / b * 1e4).round() / 1e4
    }

    #[test]
    fn published_runs_have_the_published_rates() {
        let published = RateConfig::published();
        let [first, middle, last] = rates(30_000, published);
        assert_eq!([first.opacity, middle.opacity, last.opacity], [published.opacity; 3]);
        assert_eq!([first.texel, middle.texel], [0.0, published.texel]);
        assert_eq!(ratio(last.position, published.position_end), 1.0);
    }

    #[test]
    fn rates_are_higher_in_short_runs_and_fall_at_their_end() {
        let [long, ..] = rates(30_000, RateConfig::default());
        let raises = |steps, config| {
            let [first, ..] = rates(steps, config);
            [
                ratio(first.quaternion, long.quaternion),
                ratio(first.sh_dc, long.sh_dc),
                ratio(first.opacity, long.opacity),
            ]
        };
        assert_eq!(raises(30_000 / 16, RateConfig::default()), [9.1896, 4.5948, 2.2974]);
        assert_eq!(raises(30_000 / 16, RateConfig::published()), [4.0, 2.0, 1.0]);
        assert_eq!(raises(100, RateConfig::default()), [27.8576, 9.8492, 3.4822]);
        let [_, middle, last] = rates(3_000, RateConfig::default());
        assert_eq!([ratio(last.opacity, middle.opacity), ratio(last.texel, middle.texel)], [0.1002; 2]);
    }
}
