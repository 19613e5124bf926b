//! What changes over a run, as fractions of its length: `s = steps / 30,000` scales the published
//! timetable (method sections 4 and 6).

use super::config::TrainConfig;
use crate::backend::LearningRates;

/// Length of the published timetable.
const PUBLISHED_STEPS: f64 = 30_000.0;

/// Rates are raised by at most this: shorter runs than 470 steps gain nothing more.
const HIGHEST_RAISE: f64 = 8.0;

/// The timetable of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// SH degree rises by one each so many steps (published: 1,000).
    pub sh_interval: u32,
    /// Texels are trained from this step on (published: 1,000).
    pub texture_start: u32,
    /// The position's rate reaches its end here (published: 24,000).
    pub position_end: u32,
    /// Maps are revised each so many steps (published: structure steps each 250).
    pub revision_interval: u32,
}

impl Schedule {
    /// The timetable for `config` and a number of training views.
    pub fn new(config: &TrainConfig, train_views: usize) -> Self {
        let s = f64::from(config.steps) / PUBLISHED_STEPS;
        let at = |published: f64| ((published * s).round() as u32).max(1);
        let low = (train_views as u32).clamp(1, 50);
        Self {
            sh_interval: at(1_000.0),
            texture_start: at(1_000.0),
            position_end: at(24_000.0),
            revision_interval: at(250.0).clamp(low, 250),
        }
    }

    /// SH degree in use at a step (from 1).
    pub fn sh_degree(&self, step: u32, highest: u32) -> u32 {
        ((step - 1) / self.sh_interval).min(highest)
    }

    /// Learning rates of a step (from 1).
    ///
    /// The published rates are made for 30,000 steps; with Adam, a run of a tenth of them cannot travel
    /// far enough. Unless switched off, rates rise with the square root of the missing length
    /// (log-scales and SH degree 0: the fourth root; opacity: not). Measured, fox at 270x480, 500 steps:
    /// 23.96 dB as published, 27.1 dB raised (`benches/bench_scene.rs`).
    pub fn rates(&self, config: &TrainConfig, step: u32) -> LearningRates {
        let r = &config.rates;
        let t = (f64::from(step - 1) / f64::from(self.position_end)).min(1.0);
        let (start, end) = (f64::from(r.position).ln(), f64::from(r.position_end).ln());
        let missing = if r.raise_in_short_runs { PUBLISHED_STEPS / f64::from(config.steps) } else { 1.0 };
        let raise = missing.max(1.0).sqrt().min(HIGHEST_RAISE);
        let (fast, slow) = (raise as f32, raise.sqrt() as f32);
        LearningRates {
            position: fast * (start + (end - start) * t).exp() as f32,
            quaternion: fast * r.quaternion,
            log_scale: slow * r.log_scale,
            opacity: r.opacity,
            sh_dc: slow * r.sh_dc,
            sh_rest: fast * r.sh_rest,
            texel: if step >= self.texture_start { fast * r.texel } else { 0.0 },
            texel_growth: 0.0,
            texel_growth_limit: 1.0,
        }
    }

    /// Whether maps are revised after a step.
    pub fn revises(&self, step: u32, steps: u32) -> bool {
        step.is_multiple_of(self.revision_interval) && step < steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_timetable_is_met_and_short_runs_are_fractions_of_it() {
        let config = TrainConfig::default();
        let published = Schedule::new(&config, 300);
        assert_eq!(
            (published.sh_interval, published.texture_start, published.revision_interval),
            (1_000, 1_000, 250)
        );
        assert_eq!([1, 1_000, 1_001, 3_001, 9_000].map(|t| published.sh_degree(t, 3)), [0, 0, 1, 3, 3]);
        let rates = published.rates(&config, 24_001);
        assert!((rates.position / config.rates.position_end - 1.0).abs() < 1e-5);
        assert_eq!(published.rates(&config, 999).texel, 0.0);
        let shorter = TrainConfig { steps: 300, ..config.clone() };
        let short = Schedule::new(&shorter, 43);
        let raise = short.rates(&shorter, 1).position / published.rates(&config, 1).position;
        assert!((raise - 8.0).abs() < 1e-4, "{raise}");
        assert_eq!(short.rates(&shorter, 1).opacity, config.rates.opacity);
        assert_eq!((short.sh_interval, short.texture_start, short.revision_interval), (10, 10, 43));
        assert!(short.revises(43, 300) && !short.revises(300, 300) && !short.revises(44, 300));
    }
}
