//! Settings of a training run: everything that shapes the result. The command line and `config.toml` fill
//! them in, the trainer reads them.
//!
//! Every default names its source: the paper, by the title of the section; 3DGS or CAT (content-aware
//! texturing), whose values the paper inherits; the configuration that the authors published with their code;
//! a section of `docs/choices.md` ("choices 2") or `docs/method.md` ("method 6.1"); or "not measured".

use super::density::{Budget, Components, DensityConfig, MapRule};
use crate::backend::LossWeights;
use crate::frequency::FrequencyOptions;
use crate::model::Filter;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How splats and texels are allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Policy {
    /// High-error splats are refined or split (LiteTex-GS).
    Litetex,
    /// Content-aware texturing, the ancestor: as `litetex`, without scheduler, ceilings, pruning by
    /// contribution and resolution-aware rates.
    Cat,
    /// R x R texels for every splat; splats as with `litetex`.
    Fixed(u16),
    /// 2DGS-MCMC: no textures, splats are relocated and added by error (method 6.12).
    Plain,
    /// No textures; splats as with `litetex`.
    None,
}

impl Policy {
    /// The rule that sets the sizes of maps.
    pub fn map_rule(self) -> MapRule {
        match self {
            Self::Litetex | Self::Cat => MapRule::Adaptive,
            Self::Fixed(resolution) => MapRule::Fixed(resolution),
            Self::Plain | Self::None => MapRule::None,
        }
    }

    /// Side of the initial maps, in texels.
    pub fn first_side(self) -> u16 {
        match self {
            // Paper, Adaptive Per-Gaussian Texture Optimization.
            Self::Litetex => 2,
            // CAT.
            Self::Cat => 8,
            Self::Fixed(resolution) => resolution,
            Self::Plain | Self::None => 0,
        }
    }

    /// Texels of each initial splat.
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

/// Whether large splats stand behind the points where training rays meet none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backdrop {
    /// Where they are needed, unless the photos have an alpha channel.
    #[default]
    Auto,
    /// Nowhere.
    None,
}

/// How the trainer treats photos of different exposure and white balance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Exposure {
    /// As if all were alike.
    #[default]
    None,
    /// Estimates an affine colour map for each training photo.
    Affine,
}

/// Learning rates for 30,000 steps (method 4.2). Variations of most were measured (choices 2).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RateConfig {
    /// Centres at the first step, local units. Default 1.6e-4 (3DGS).
    pub position: f32,
    /// The same for random initialisation, where splats have further to go. Default 6.4e-4 (choices 3).
    pub position_random: f32,
    /// Centres at the end of their decay, which is log-linear. Default 1.6e-6 (3DGS).
    pub position_end: f32,
    /// Quaternions. Default 1e-3 (3DGS).
    pub quaternion: f32,
    /// Log-scales. Default 5e-3 (3DGS).
    pub log_scale: f32,
    /// Opacity logits. Default 0.05 (3DGS).
    pub opacity: f32,
    /// SH degree 0. Default 2.5e-3 (3DGS).
    pub sh_dc: f32,
    /// SH degrees 1 to 3. Default 1.25e-4 (3DGS; not measured).
    pub sh_rest: f32,
    /// Texels of a 2 x 2 map. Default 7e-4 (authors' configuration; choices 2).
    pub texel: f32,
    /// Exponent by which larger maps learn faster: a map of T texels by (T / 4) to this power. Default 0.5
    /// (gamma in the paper, Resolution-Aware Optimization; choices 11).
    pub texel_growth: f32,
    /// Largest factor by which a map learns faster. Default 4 (lambda_max, there too; choices 11).
    pub texel_growth_limit: f32,
    /// Whether runs shorter than the published 30,000 steps use higher rates, see
    /// [`Schedule::rates`](super::Schedule::rates). Default on (choices 12).
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
    /// Length of the run; schedules are fractions of it. Default 30,000 (paper, Experimental Setup).
    pub steps: u32,
    /// Training time after which the run stops early, evaluation not counted. Default none.
    pub max_time_secs: Option<f64>,
    /// Seed of everything random. Default 42 (arbitrary; choices 10 has the spread over seeds).
    pub seed: u64,
    /// Highest SH degree, 0 to 3. Default 3 (3DGS; the paper counts its parameters).
    pub sh_degree: u32,
    /// Whether initialisation is random, which selects [`RateConfig::position_random`]. Set with the initial model.
    pub random_start: bool,
    /// Allocation of splats and texels. Default `litetex` (choices 5 and 7).
    pub policy: Policy,
    /// Parts of the method that are on. Default all (choices 6).
    pub components: Components,
    /// Upper bounds on the model's size. Default none.
    pub budget: Budget,
    /// Density control.
    pub density: DensityConfig,
    /// Frequency schedule.
    pub scheduler: FrequencyOptions,
    /// Whether the initial model gets points from the photos where the capture has few. Default on (choices 13).
    pub sweep: bool,
    /// Large splats behind the points. Default `auto` (choices 13).
    pub backdrop: Backdrop,
    /// Correction of the photos' exposures. Default `none`.
    pub exposure: Exposure,
    /// Low-pass filter in the image. Default `ewa` (choices 14; `paper`: none).
    pub filter: Filter,
    /// Display-space colour behind all splats, 0 to 1. Default black (3DGS).
    pub background: [f32; 3],
    /// Whether every step draws a background of its own, so that transparency in photos with alpha is learnt. Needs a
    /// black `background`, for images. Default off (3DGS).
    pub random_background: bool,
    /// Steps between evaluations of the test views; 0: only at the end. Default 0: does not change the model.
    pub eval_every: u32,
    /// Steps between checkpoints; 0: only at the end. Default 0: does not change the model.
    pub save_every: u32,
    /// Weights of the loss terms.
    pub loss: LossWeights,
    /// Learning rates and their schedule.
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
            sweep: true,
            backdrop: Backdrop::Auto,
            exposure: Exposure::None,
            filter: Filter::Ewa,
            background: [0.0; 3],
            random_background: false,
            eval_every: 0,
            save_every: 0,
            loss: LossWeights::default(),
            rates: RateConfig::default(),
        }
    }
}

impl TrainConfig {
    /// The parts that are on, less those that the policy excludes.
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
