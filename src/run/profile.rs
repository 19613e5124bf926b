//! Named sets of defaults. A profile replaces the defaults before any other option applies; `config.toml` records its
//! settings one by one.

use crate::backend::LossWeights;
use crate::frequency::ScheduleRules;
use crate::model::Filter;
use crate::train::density::DensityConfig;
use crate::train::{Backdrop, Policy, RateConfig, TrainConfig};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// A named set of defaults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// The settings that measured best.
    #[default]
    Default,
    /// Constants and rules as published.
    Paper,
    /// Closer to the program behind the published tables.
    Authors,
    /// Content-aware texturing (CAT), the method's predecessor.
    Cat,
}

impl Profile {
    /// All profiles.
    pub const ALL: [Self; 4] = [Self::Default, Self::Paper, Self::Authors, Self::Cat];

    /// One line for people.
    pub fn help(self) -> &'static str {
        match self {
            Self::Default => "The settings that measured best",
            Self::Paper => "Constants and rules as published",
            Self::Authors => {
                "Closer to the program behind the published tables: immediate pruning, warm restarts, error mass, generous \
                 ceilings; its crops, interval and initial maps are not reproduced"
            }
            Self::Cat => "Content-aware texturing (CAT), the method's predecessor",
        }
    }

    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Paper => "paper",
            Self::Authors => "authors",
            Self::Cat => "cat",
        }
    }

    /// The profile that a policy is part of, if it is not on offer by itself.
    pub fn of(policy: Policy) -> Option<Self> {
        match policy {
            Policy::Paper => Some(Self::Paper),
            Policy::Authors => Some(Self::Authors),
            Policy::Cat => Some(Self::Cat),
            Policy::Litetex | Policy::Fixed(_) | Policy::Plain | Policy::None => None,
        }
    }

    /// The settings of a run that changes nothing else.
    pub fn settings(self) -> TrainConfig {
        let mut config = TrainConfig::default();
        self.apply(&mut config);
        config
    }

    /// Replaces all settings that profiles decide, so that nothing of another profile is left.
    pub fn apply(self, config: &mut TrainConfig) {
        let fresh = TrainConfig::default();
        *config = TrainConfig {
            policy: fresh.policy,
            components: fresh.components,
            density: fresh.density,
            scheduler: fresh.scheduler,
            sweep: fresh.sweep,
            backdrop: fresh.backdrop,
            exposure: fresh.exposure,
            filter: fresh.filter,
            loss: fresh.loss,
            rates: fresh.rates,
            ..config.clone()
        };
        if matches!(self, Self::Paper | Self::Authors | Self::Cat) {
            config.sweep = false;
            config.backdrop = Backdrop::None;
            config.filter = Filter::None;
            config.rates = RateConfig::published();
        }
        let paper = || DensityConfig {
            quantile: 0.85,
            alpha_texture: crate::constants::ALPHA_MIN,
            sh_below: 0.0,
            sh_raise: 0.0,
            grow_by_axis: 0.0,
            prune_db: 0.0,
            price_fragments: 0.0,
            ..DensityConfig::default()
        };
        match self {
            Self::Default => {}
            Self::Paper => {
                config.policy = Policy::Paper;
                config.density = paper();
                config.scheduler.rules = ScheduleRules::Paper;
                config.loss = LossWeights::PUBLISHED;
            }
            Self::Authors => {
                config.policy = Policy::Authors;
                config.density = DensityConfig { patience_steps: 0, ..paper() };
                config.scheduler.rules = ScheduleRules::Authors;
                config.loss = LossWeights { mse: 0.03, ..LossWeights::PUBLISHED };
            }
            Self::Cat => {
                config.policy = Policy::Cat;
                config.loss = LossWeights::PUBLISHED;
                config.density = DensityConfig {
                    quantile: 0.9,
                    split_texels: [64.0, 32.0],
                    texture_start: 500,
                    // Its maps end at sqrt(ln(255 o)) standard deviations, where alpha is 0.02 to 0.06.
                    alpha_texture: 0.05,
                    ..paper()
                };
            }
        }
    }
}

impl FromStr for Profile {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|profile| profile.name() == text);
        found.ok_or_else(|| format!("{text:?}: expected {}", Self::ALL.map(Self::name).join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_profiles_have_nothing_that_is_ours() {
        let config = |profile: Profile| {
            let mut config = TrainConfig::default();
            profile.apply(&mut config);
            config
        };
        let density = |profile: Profile| config(profile).density;
        for profile in [Profile::Paper, Profile::Authors, Profile::Cat] {
            let density = density(profile);
            let ours =
                [density.sh_below, density.sh_raise, density.grow_by_axis, density.prune_db, density.need_db];
            assert_eq!((ours, density.price_fragments), ([0.0; 5], 0.0));
            let TrainConfig { sweep, backdrop, filter, rates, .. } = config(profile);
            assert_eq!((sweep, backdrop, filter), (false, Backdrop::None, Filter::None));
            assert_eq!(rates, RateConfig::published());
        }
        // Negative control: the default has all of them.
        let TrainConfig { sweep, backdrop, filter, rates, .. } = config(Profile::Default);
        assert!(sweep && backdrop != Backdrop::None && filter != Filter::None);
        assert!(rates != RateConfig::published());
        assert_eq!(density(Profile::Default), DensityConfig::default());
    }
}
