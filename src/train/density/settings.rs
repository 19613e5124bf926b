//! Settings of density control and pruning. All times are steps of the published timetable of 30,000;
//! [`Schedule`](crate::train::Schedule) scales them to the run. Each default names its source, as in
//! [`TrainConfig`](crate::train::TrainConfig). What only one rule needs is a constant of that rule.

use crate::backend::DeviceLimits;
use crate::model::ModelSize;
use crate::train::charge::Charge;
use serde::{Deserialize, Serialize};

/// Parts of the method that can be switched off one by one. Default: all on (method 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Components {
    /// Frequency schedule: image size, texture cap and number of splats follow from the photos' spectra. Off:
    /// full size, a cap of 256 texels, and splits of a fifth of the splats a step.
    pub scheduler: bool,
    /// Pruning: of splats that contribute or cover too little for several checks in a row and, after growth, of what the model
    /// does not miss.
    pub pruning: bool,
    /// Map ceilings that start low and double with error. Off: maps are refined by error alone.
    pub growth: bool,
    /// Rates of texels that rise with the size of their map.
    pub update_rule: bool,
    /// Splitting of splats along their longer axis.
    pub splitting: bool,
    /// Coarsening of maps that hardly change by it.
    pub coarsening: bool,
}

impl Components {
    /// Names of the switches, in the order of the fields.
    pub const NAMES: [&str; 6] = ["scheduler", "pruning", "growth", "update-rule", "splitting", "coarsening"];

    /// The switch of this name, if there is one.
    pub fn switch(&mut self, name: &str) -> Option<&mut bool> {
        let Self { scheduler, pruning, growth, update_rule, splitting, coarsening } = self;
        let all = [scheduler, pruning, growth, update_rule, splitting, coarsening];
        Self::NAMES.iter().zip(all).find(|(n, _)| **n == name).map(|(_, switch)| switch)
    }
}

impl Default for Components {
    fn default() -> Self {
        Self {
            scheduler: true,
            pruning: true,
            growth: true,
            update_rule: true,
            splitting: true,
            coarsening: true,
        }
    }
}

/// Settings of density control and pruning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct DensityConfig {
    /// Steps between density-control steps. Default: what the policy says, or an epoch of a short run (method 6.1).
    pub interval: Option<u32>,
    /// First density-control step that uses statistics. Default 500 (authors' configuration; not measured).
    pub start: u32,
    /// Last step after which splats are split and maps refined. Default: what the policy says.
    pub densify_until: Option<u32>,
    /// Step from which texels are trained. Default 1,000 (authors' configuration; not measured).
    pub texture_start: u32,
    /// Parameters that the scene does not need are left out, with a budget too: growth ends where 10 % more of them lower the
    /// error of the training views by less than this, dB of PSNR, and pruning does not stop at the budget (method 6.14). 0:
    /// growth ends with densification (default; the paper).
    pub need_db: f64,
    /// Pruning takes the last 10 % of the parameters where that costs the training views less than this, dB of PSNR; 0: no
    /// pruning after growth (the paper). Default 0.05 (method 6.15).
    pub prune_db: f64,
    /// What all rasterised fragments together count in pruning after growth, over what the charge of the model counts; 0: nothing
    /// (default; method 6.15; not in the paper).
    pub price_fragments: f64,
    /// PSNR of the training views that is good enough, dB: its error is added to that of the model in the threshold of
    /// pruning. Default 40 (method 6.15).
    pub floor_db: f64,
    /// Whether pruning merges neighbours that lie in one plane. Default on (method 6.16).
    pub merge: bool,
    /// How far growth may exceed a budget of parameters, which pruning then meets, as a factor. Default 2.5 (method 6.15).
    pub overshoot: f64,
    /// Quantile above which the error of a splat is high. Maps of such splats may be refined and are not coarsened; without a budget
    /// of parameters, only such splats are split. Default 0.6 (method 6.6; paper: 0.85, for Tanks & Temples 0.6).
    pub quantile: f64,
    /// Finest texel, in pixels of the nearest camera at the image size of the stage. Default 2 (CAT; method 6.5).
    pub min_texel_px: f64,
    /// Alpha at which maps end. Default 0.25 (method 6.4; paper: 1/255).
    pub alpha_texture: f64,
    /// A map is coarsened if that changes its image by less, as a mean weighted by the falloff. Default 0.02
    /// (CAT; method 6.5).
    pub coarsen_below: f64,
    /// A map is refined along only one axis if its texels vary there more than along the other by this factor, as mean
    /// squared differences between neighbours, and may be coarsened along one axis alone; 0: always along both.
    /// Default 4 (method 6.7; not in the paper).
    pub grow_by_axis: f64,
    /// Length in finest texels above which splats are split: at step 0, and from step 7,000 on, linear in between. With a budget
    /// of parameters `litetex` splits splats of any length. Default 64 and 16 (CAT, authors' configuration; method 6.8).
    pub split_texels: [f64; 2],
    /// SH bands of a splat of mean contribution are dropped if they change its colour by less, root mean square over
    /// directions; 0: none. Default 0.01 (method 6.13; not in the paper).
    pub sh_below: f64,
    /// A splat may gain another SH band if its highest one, once tested, changes its colour by this much, measured as for
    /// `sh_below`; 0, or `sh_below` 0: none. Default 0.02 (method 6.13).
    pub sh_raise: f64,
    /// Sum over the training views of blending weight per pixel below which the prune count rises. Default 5e-6
    /// (paper, Contribution- and Area-Aware Geometric Management; method 6.3).
    pub prune_contribution: f64,
    /// Sum over the training views of the covered share of the image below which the prune count rises. Default
    /// 5e-5 (paper, as above; method 6.3).
    pub prune_area: f64,
    /// Patience as steps of the published timetable. Default 2,000 (paper, as above: 8 checks; method 6.3).
    pub patience_steps: u32,
    /// Opacity below which splats fade, or are relocated (`plain`): at step 0 and at the last, linear in between. Default: what the
    /// policy says.
    pub opacity_floor: Option<[f64; 2]>,
}

impl Default for DensityConfig {
    fn default() -> Self {
        Self {
            interval: None,
            start: 500,
            densify_until: None,
            texture_start: 1_000,
            need_db: 0.0,
            prune_db: 0.05,
            price_fragments: 0.0,
            floor_db: 40.0,
            merge: true,
            overshoot: 2.5,
            quantile: 0.6,
            min_texel_px: 2.0,
            alpha_texture: 0.25,
            coarsen_below: 0.02,
            grow_by_axis: 4.0,
            split_texels: [64.0, 16.0],
            sh_below: 0.01,
            sh_raise: 0.02,
            prune_contribution: 5e-6,
            prune_area: 5e-5,
            patience_steps: 2_000,
            opacity_floor: None,
        }
    }
}

/// Upper bounds on the size of the model; `None`: no bound, the default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Budget {
    /// Bound on the number of splats.
    pub max_splats: Option<usize>,
    /// Bound on the number of texels over all maps.
    pub max_texels: Option<usize>,
    /// Bound on the number of parameters, see [`ModelSize::params`].
    pub max_params: Option<usize>,
}

impl Budget {
    /// Whether a model of this size is within the budget.
    pub fn allows(&self, size: &ModelSize) -> bool {
        self.max_splats.is_none_or(|most| size.splats <= most)
            && self.max_texels.is_none_or(|most| size.texels <= most)
            && self.max_params.is_none_or(|most| size.params() <= most)
    }

    /// The budget after a share of the steps to the end of densification. It rises evenly from the initial size, so
    /// that capacity is left for detail that only full-size images show, and is never below the size `now`.
    pub fn paced(&self, share: f64, start: &ModelSize, now: &ModelSize) -> Self {
        let part = |most: Option<usize>, start: usize, now: usize| {
            let paced = |most: usize| start + (most.saturating_sub(start) as f64 * share) as usize;
            most.map(|most| paced(most).max(now).min(most))
        };
        Self {
            max_splats: part(self.max_splats, start.splats, now.splats),
            max_texels: part(self.max_texels, start.texels, now.texels),
            max_params: part(self.max_params, start.params(), now.params()),
        }
    }

    /// The smaller bounds of both.
    pub fn and(&self, other: &Self) -> Self {
        let part = |a: Option<usize>, b: Option<usize>| a.into_iter().chain(b).min();
        Self {
            max_splats: part(self.max_splats, other.max_splats),
            max_texels: part(self.max_texels, other.max_texels),
            max_params: part(self.max_params, other.max_params),
        }
    }

    /// This budget on a device with limits: splats and texels are bounded by the smaller of both.
    pub fn within(&self, device: &DeviceLimits) -> Self {
        let part = |most: Option<usize>, device: u64| {
            let device = usize::try_from(device).unwrap_or(usize::MAX);
            Some(most.map_or(device, |most| most.min(device)))
        };
        Self {
            max_splats: part(self.max_splats, device.max_splats),
            max_texels: part(self.max_texels, device.max_texels),
            max_params: self.max_params,
        }
    }

    /// Largest number of splats, with `texels_each` texels each, that fits.
    pub fn most_splats(&self, texels_each: usize, sh_degree: u32) -> usize {
        let by = |most: Option<usize>, each: usize| most.map_or(usize::MAX, |m| m / each.max(1));
        let texels = if texels_each == 0 { usize::MAX } else { by(self.max_texels, texels_each) };
        by(self.max_splats, 1)
            .min(texels)
            .min(by(self.max_params, ModelSize::uniform(1, texels_each, sh_degree).params()))
    }
}

/// What the model may grow to.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// Splats, texels, parameters.
    pub budget: Budget,
    /// What it is charged for.
    pub charge: Charge,
    /// Its largest charge.
    pub most_charge: f64,
}

impl Bound {
    /// Largest number of splats, with `texels_each` texels each, that is within the bound.
    pub fn most_splats(&self, texels_each: usize, sh_degree: u32) -> usize {
        let each = self.charge.of(sh_degree as u8, texels_each);
        self.budget.most_splats(texels_each, sh_degree).min((self.most_charge / each) as usize)
    }

    /// Whether a model of this size is within the bound.
    pub fn allows(&self, size: &ModelSize) -> bool {
        self.budget.allows(size) && self.charge.of_size(size) <= self.most_charge
    }
}
