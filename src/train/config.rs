//! Settings of a training run: everything that shapes the result, with defaults and their sources.
//! The command line and `config.toml` fill it; the trainer reads it.

use crate::backend::LossWeights;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Who gets how many texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum TexturePolicy {
    /// No textures: plain 2D Gaussians.
    None,
    /// R x R texels for every splat.
    Fixed(u16),
}

impl FromStr for TexturePolicy {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" {
            return Ok(Self::None);
        }
        let resolution = text.strip_prefix("fixed:").and_then(|r| r.parse().ok());
        match resolution {
            Some(r @ 2..=256) => Ok(Self::Fixed(r)),
            _ => Err(format!("{text:?}: expected \"none\" or \"fixed:R\" with R from 2 to 256")),
        }
    }
}

impl fmt::Display for TexturePolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Fixed(r) => write!(f, "fixed:{r}"),
        }
    }
}

impl TryFrom<String> for TexturePolicy {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<TexturePolicy> for String {
    fn from(policy: TexturePolicy) -> Self {
        policy.to_string()
    }
}

/// Learning rates at the start, and their schedule (method section 4).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RateConfig {
    /// Centres at the start, local units (where the cameras' extent is 1).
    pub position: f32,
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
    /// Texels.
    pub texel: f32,
    /// Whether runs shorter than the published 30,000 steps use higher rates; see
    /// [`Schedule::rates`](super::Schedule::rates).
    pub raise_in_short_runs: bool,
}

impl Default for RateConfig {
    fn default() -> Self {
        Self {
            position: 1.6e-4,
            position_end: 1.6e-6,
            quaternion: 1e-3,
            log_scale: 5e-3,
            opacity: 0.05,
            sh_dc: 2.5e-3,
            sh_rest: 1.25e-4,
            texel: 7e-4,
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
    /// Texture allocation.
    pub texture: TexturePolicy,
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
            texture: TexturePolicy::Fixed(4),
            background: [0.0; 3],
            eval_every: 0,
            save_every: 0,
            loss: LossWeights::default(),
            rates: RateConfig::default(),
        }
    }
}
