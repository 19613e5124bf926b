//! Backgrounds that change from step to step (method 3.2).

use super::config::TrainConfig;
use super::random::RandomStream;
use rand::RngExt as _;

/// Background of a step: the one of the settings, or a colour drawn for the step.
pub(super) fn background_of(config: &TrainConfig, step: u32) -> [f32; 3] {
    if !config.random_background {
        return config.background;
    }
    let mut rng = RandomStream::Background.at(config.seed, step);
    [0; 3].map(|_| rng.random())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds_differ_by_step_and_seed_and_repeat() {
        let config = TrainConfig { random_background: true, ..TrainConfig::default() };
        let of = |step| background_of(&config, step);
        assert!(of(1) != of(2) && of(1) == of(1));
        assert_ne!(background_of(&TrainConfig { seed: 43, ..config.clone() }, 1), of(1));
        let mean = (0..1000).map(|step| of(step)[1]).sum::<f32>() / 1000.0;
        assert!((mean - 0.5).abs() < 0.05, "{mean}");
        assert_eq!(background_of(&TrainConfig::default(), 1), [0.0; 3]);
    }
}
