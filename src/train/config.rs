//! Settings of a training run: everything that shapes the result. The command line and `config.toml` fill
//! them in, the trainer reads them.
//!
//! Every default names its source: the paper, by the title of the section; 3DGS or CAT (content-aware
//! texturing), whose values the paper inherits; the configuration that the authors published with their code;
//! a section of `docs/method.md` ("method 6.1"), which has the measurement; or "not measured".

use super::colour::deserialize_colour;
use super::density::{Bound, Budget, Components, DensityConfig, Policy, RuleSpec};
use crate::backend::LossWeights;
use crate::constants::sh_coefficients;
use crate::frequency::FrequencyOptions;
use crate::model::{Filter, ModelSize};
use crate::text::format_count;
use serde::{Deserialize, Serialize};

/// Whether large splats stand behind the points where training rays meet none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backdrop {
    /// Where they are needed, unless the photos have transparent pixels.
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

/// Learning rates for 30,000 steps (method 4.2).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RateConfig {
    /// Centres at the first step, local units. Default 1.6e-4 (3DGS).
    pub position: f32,
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
    /// Texels of a 2 x 2 map. Default 7e-4 (authors' configuration; method 4.2).
    pub texel: f32,
    /// Exponent by which larger maps learn faster: a map of T texels by (T / 4) to this power. Default 0.5
    /// (gamma in the paper, Resolution-Aware Optimization; method 4.2).
    pub texel_growth: f32,
    /// Largest factor by which a map learns faster. Default 4 (lambda_max, there too; method 4.2).
    pub texel_growth_limit: f32,
    /// Power of the missing length by which rates are higher in runs shorter than the published 30,000 steps, see
    /// [`Schedule::rates`](super::Schedule::rates). Default 0.8 (method 4.2).
    pub raise: f64,
    /// Factor to which all rates fall in the last third of a run. Default 0.1 (method 4.2).
    pub fall: f64,
}

impl RateConfig {
    /// Rates of profiles with published constants. They rise with the root of the missing length, since the published ones are too
    /// low for any short run.
    pub fn published() -> Self {
        Self { raise: 0.5, fall: 1.0, ..Self::default() }
    }
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
            texel_growth: 0.5,
            texel_growth_limit: 4.0,
            raise: 0.8,
            fall: 0.1,
        }
    }
}

/// Steps done when the length of a run changed, and steps of the whole run from then on.
pub type LengthChange = [u32; 2];

/// Bytes of the file per parameter at [`params_for_bytes`]; pruned models have 0.37 to 0.42.
const BYTES_PER_PARAM: f64 = 0.35;

/// Most parameters of a model in training for a `.ltgs` file with this many bytes for splats; pruning by bytes leaves fewer
/// (method 10.1).
pub fn params_for_bytes(splat_bytes: f64) -> usize {
    (splat_bytes / BYTES_PER_PARAM) as usize
}

/// Most parameters for each step of a run with a wanted size, of 1,000 steps or more: more take a third more time and gain
/// gradient-PSNR only (measured: lab/choices.md 24).
const PARAMS_PER_STEP: usize = 600;

/// Settings of a training run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct TrainConfig {
    /// Length of the run; schedules are fractions of it. Default 30,000 (paper, Experimental Setup).
    pub steps: u32,
    /// Changes of the length that a run with a time made on its way: `[steps done, steps of the whole run from then on]`.
    /// Default none.
    pub plan: Vec<LengthChange>,
    /// Seed of everything random. Default 42 (arbitrary; method 5.2 has the spread over seeds).
    pub seed: u64,
    /// Highest SH degree, 0 to 3. Default 3 (3DGS; the paper counts its parameters).
    pub sh_degree: u32,
    /// Allocation of splats and texels. Default `litetex` (method 9.1).
    pub policy: Policy,
    /// Parts of the method that are on. Default all (method 9.2).
    pub components: Components,
    /// Upper bounds on the model's size. Default none.
    pub budget: Budget,
    /// Size of the `.ltgs` file with which the run ends, bytes: its numbers are trained as they are rounded. Default none
    /// (method 10).
    pub max_bytes: Option<u64>,
    /// Density control.
    pub density: DensityConfig,
    /// Frequency schedule.
    pub scheduler: FrequencyOptions,
    /// Whether the initial model gets points from the photos where the capture has few. Default on (method 5.4).
    pub sweep: bool,
    /// Large splats behind the points. Default `auto` (method 5.3).
    pub backdrop: Backdrop,
    /// Correction of the photos' exposures. Default `none`.
    pub exposure: Exposure,
    /// Low-pass filter in the image. Default `ewa` (method 2.5; `paper`: none).
    pub filter: Filter,
    /// Display-space colour behind all splats, 0 to 1; as text, too: white, #rrggbb. Default black (3DGS).
    #[serde(deserialize_with = "deserialize_colour")]
    pub background: [f32; 3],
    /// Whether every step draws a background of its own, so that transparency in photos with alpha is learnt. Needs a
    /// black `background`, for images. Default off (3DGS).
    pub random_background: bool,
    /// Steps between evaluations of the test views; 0: only at the end. Default 0: does not change the model.
    pub eval_every: u32,
    /// Steps between checkpoints, all of which are kept; 0: one at the end. Default 0: does not change the model.
    pub save_every: u32,
    /// Where `save_every` is 0: seconds after which an interim checkpoint replaces the one before it, so that a run that is
    /// killed can be resumed; 0: never. Default 60 (what a power cut may cost): does not change the model.
    pub save_secs: u32,
    /// Weights of the loss terms.
    pub loss: LossWeights,
    /// Learning rates and their schedule.
    pub rates: RateConfig,
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            steps: 30_000,
            plan: Vec::new(),
            seed: 42,
            sh_degree: 3,
            policy: Policy::Litetex,
            components: Components::default(),
            budget: Budget::default(),
            max_bytes: None,
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
            save_secs: 60,
            loss: LossWeights::default(),
            rates: RateConfig::default(),
        }
    }
}

impl TrainConfig {
    /// Steps of the run with all changes of its length.
    pub fn last_step(&self) -> u32 {
        self.plan.last().map_or(self.steps, |change| change[1])
    }

    /// Most parameters of the finished model: its budget, and with a wanted size no more than the steps can train (method 10.1).
    pub fn most_params(&self) -> Option<usize> {
        let steps = self.last_step().max(1_000) as usize;
        let trainable = self.max_bytes.map(|_| PARAMS_PER_STEP.saturating_mul(steps));
        [self.budget.max_params, trainable].into_iter().flatten().min()
    }

    /// What bounds the parameters, as messages name it.
    pub fn params_bound(&self) -> &'static str {
        // With a size, the budget follows from it unless it is given.
        if self.max_bytes.is_some() { "the budget of --max-size" } else { "--budget-params" }
    }

    /// The bound with its number.
    pub fn named_bound(&self, params: usize) -> String {
        let (bound, params) = (self.params_bound(), format_count(params as u64));
        if self.max_bytes.is_some() {
            format!("{bound} ({params} parameters)")
        } else {
            format!("{bound} {params}")
        }
    }

    /// Checks the changes of the length: in order, each before the end that it moves.
    ///
    /// # Errors
    /// A message with the change.
    pub fn check_plan(&self) -> Result<(), String> {
        let (mut done, mut end) = (0, self.steps);
        for &[at, last] in &self.plan {
            if at <= done || at >= end || last <= at {
                return Err(format!(
                    "train.plan: found [{at}, {last}] in a run of {end} steps; expected [steps done, steps of the \
                     whole run], in order"
                ));
            }
            (done, end) = (at, last);
        }
        Ok(())
    }

    /// Lowest SH degree that a new model may have so that more of its points fit the budget: 1, or that of the run if bands
    /// are never pruned (method 6.13).
    pub fn least_sh_degree(&self) -> u32 {
        if self.density.sh_below > 0.0 { self.sh_degree.min(1) } else { self.sh_degree }
    }

    /// SH degree of a new model of this size: the highest within the bound, from the lowest.
    pub fn first_sh_degree(&self, size: ModelSize, bound: &Bound) -> u32 {
        let fits = |&degree: &u32| {
            let sh_coefficients = size.splats.saturating_mul(sh_coefficients(degree));
            bound.allows(&ModelSize { sh_coefficients, ..size })
        };
        let least = self.least_sh_degree();
        (least..=self.sh_degree).rev().find(fits).unwrap_or(least)
    }

    /// What the rule of the policy asks of this run.
    pub fn rule(&self) -> RuleSpec {
        self.policy.spec().rule.spec(&self.budget, self.steps)
    }

    /// Whether the model is pruned after growth, if there is time.
    pub fn prunes_after_growth(&self) -> bool {
        self.density.prune_db > 0.0 && self.components.pruning
    }

    /// The parts that are on, less those that the policy excludes.
    pub fn active_components(&self) -> Components {
        let mut components = self.components;
        for name in self.policy.spec().without {
            if let Some(switch) = components.switch(name) {
                *switch = false;
            }
        }
        components
    }
}
