//! Settings of a training run: everything that shapes the result, with defaults and their sources.
//! The command line and `config.toml` fill it; the trainer reads it.

use super::density::{Budget, Components, DensityConfig, MapRule};
use crate::backend::LossWeights;
use crate::frequency::FrequencyOptions;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Who gets how many splats and texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Policy {
    /// Maps grow with error, splats are split where their maps are full (LiteTex-GS).
    Litetex,
    /// The ancestor's allocation: as above without scheduler, ceilings, pruning by contribution and
    /// resolution-aware rates (content-aware texturing).
    Cat,
    /// R x R texels for every splat, splats as with `litetex`.
    Fixed(u16),
    /// No textures; splats are moved and added by error: the strongest untextured allocation we know.
    Plain,
    /// No textures, splats as with `litetex`.
    None,
}

impl Policy {
    /// How the sizes of maps are decided.
    pub fn map_rule(self) -> MapRule {
        match self {
            Self::Litetex | Self::Cat => MapRule::Adaptive,
            Self::Fixed(resolution) => MapRule::Fixed(resolution),
            Self::Plain | Self::None => MapRule::None,
        }
    }

    /// Texels a side of the maps at the start.
    pub fn first_side(self) -> u16 {
        match self {
            Self::Litetex => 2,
            // Content-aware texturing.
            Self::Cat => 8,
            Self::Fixed(resolution) => resolution,
            Self::Plain | Self::None => 0,
        }
    }

    /// Texels of each splat at the start.
    pub fn first_texels_each(self) -> usize {
        usize::from(self.first_side()).pow(2)
    }
}

impl FromStr for Policy {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "litetex" => return Ok(Self::Litetex),
            "cat" => return Ok(Self::Cat),
            "plain" => return Ok(Self::Plain),
            "none" => return Ok(Self::None),
            _ => {}
        }
        let resolution = text.strip_prefix("fixed:").and_then(|r| r.parse().ok());
        match resolution {
            Some(r @ 2..=256) => Ok(Self::Fixed(r)),
            _ => Err(format!("{text:?}: expected litetex, cat, plain, none or fixed:R with R from 2 to 256")),
        }
    }
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Litetex => f.write_str("litetex"),
            Self::Cat => f.write_str("cat"),
            Self::Fixed(r) => write!(f, "fixed:{r}"),
            Self::Plain => f.write_str("plain"),
            Self::None => f.write_str("none"),
        }
    }
}

impl TryFrom<String> for Policy {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Policy> for String {
    fn from(policy: Policy) -> Self {
        policy.to_string()
    }
}

/// Learning rates at the start, and their schedule (method section 4).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RateConfig {
    /// Centres at the start, local units (where the cameras' extent is 1).
    pub position: f32,
    /// The same where splats start at random places, from which they have further to go.
    pub position_random: f32,
    /// Centres at the end, log-linear in between.
    pub position_end: f32,
    /// Quaternions.
    pub quaternion: f32,
    /// Log-scales.
    pub log_scale: f32,
    /// Opacity logits.
    pub opacity: f32,
    /// SH degree 0.
    pub sh_dc: f32,
    /// SH degrees 1 to 3.
    pub sh_rest: f32,
    /// Texels of a 2 x 2 map.
    pub texel: f32,
    /// A map of T texels learns faster by (T / 4) to this power (paper: gamma)...
    pub texel_growth: f32,
    /// ... at most by this factor (paper: lambda_max).
    pub texel_growth_limit: f32,
    /// Whether runs shorter than the published 30,000 steps use higher rates; see
    /// [`Schedule::rates`](super::Schedule::rates).
    pub raise_in_short_runs: bool,
}

impl Default for RateConfig {
    fn default() -> Self {
        Self {
            position: 1.6e-4,
            position_random: 6.4e-4,
            position_end: 1.6e-6,
            quaternion: 1e-3,
            log_scale: 5e-3,
            opacity: 0.05,
            sh_dc: 2.5e-3,
            sh_rest: 1.25e-4,
            texel: 7e-4,
            texel_growth: 0.5,
            texel_growth_limit: 4.0,
            raise_in_short_runs: true,
        }
    }
}

/// Settings of a training run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct TrainConfig {
    /// Steps; schedules are fractions of it.
    pub steps: u32,
    /// Stops early after this much training time (evaluation not counted).
    pub max_time_secs: Option<f64>,
    /// Seed of everything random.
    pub seed: u64,
    /// Highest SH degree, 0 to 3.
    pub sh_degree: u32,
    /// Whether splats start at random places.
    pub random_start: bool,
    /// Allocation of splats and texels.
    pub policy: Policy,
    /// Parts of the method that are on.
    pub components: Components,
    /// Largest model.
    pub budget: Budget,
    /// Density-control steps.
    pub density: DensityConfig,
    /// Frequency-aware scheduler.
    pub scheduler: FrequencyOptions,
    /// Display-space colour behind everything, 0 to 1.
    pub background: [f32; 3],
    /// Evaluates the test views each so many steps (0: only at the end).
    pub eval_every: u32,
    /// Writes a checkpoint each so many steps (0: only at the end).
    pub save_every: u32,
    /// Loss terms.
    pub loss: LossWeights,
    /// Learning rates.
    pub rates: RateConfig,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            steps: 30_000,
            max_time_secs: None,
            seed: 42,
            sh_degree: 3,
            random_start: false,
            policy: Policy::Litetex,
            components: Components::default(),
            budget: Budget::default(),
            density: DensityConfig::default(),
            scheduler: FrequencyOptions::default(),
            background: [0.0; 3],
            eval_every: 0,
            save_every: 0,
            loss: LossWeights::default(),
            rates: RateConfig::default(),
        }
    }
}

impl TrainConfig {
    /// The parts that are on, those that the policy rules out taken off.
    pub fn active_components(&self) -> Components {
        let c = self.components;
        match self.policy {
            Policy::Cat => {
                Components { scheduler: false, pruning: false, growth: false, update_rule: false, ..c }
            }
            Policy::Plain => Components { splitting: false, growth: false, pruning: false, ..c },
            _ => c,
        }
    }
}
