//! Settings of density control: what is refined, split and pruned. All times are steps of the published
//! timetable of 30,000; [`Schedule`](crate::train::Schedule) scales them to the run. Each default names its
//! source, as in [`TrainConfig`](crate::train::TrainConfig).

use crate::backend::DeviceLimits;
use crate::model::ModelSize;
use serde::{Deserialize, Serialize};

/// Parts of the method that can be switched off one by one. Default: all on (choices 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Components {
    /// Frequency schedule: image size, texture cap and number of splats follow from the photos' spectra. Off:
    /// full size, a cap of 256 texels, and splits limited only by [`DensityConfig::split_rate`].
    pub scheduler: bool,
    /// Pruning of splats that contribute or cover too little for several checks in a row.
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

/// What counts as a splat's error (method 6.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ErrorMeasure {
    /// Loss per unit of contribution, independent of the splat's size (paper).
    Mean,
    /// Loss that the splat carries in a view; larger for larger splats.
    Mass,
    /// Loss that the splat carries in all views.
    Total,
}

/// What happens to the moments of a refined map (method 6.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GrowthMoments {
    /// Scaled as the gradients are: for quarters of a texel, first moments by 1/4, second by 1/16.
    Scaled,
    /// Kept unscaled (paper).
    Kept,
    /// Set to zero: an accidental warm restart (authors' code).
    Zero,
}

impl GrowthMoments {
    /// Factors of the first and second moments of texels that are halved along this many axes.
    pub fn scale(self, axes: usize) -> [f32; 2] {
        let area = 0.5_f32.powi(axes as i32);
        match self {
            Self::Scaled => [area, area * area],
            Self::Kept => [1.0, 1.0],
            Self::Zero => [0.0, 0.0],
        }
    }
}

/// Placement, width and opacity of the halves of a split (method 6.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SplitProfile {
    /// One standard deviation from the centre, half as wide, opacity times exp(-1/2) (CAT).
    Paper,
    /// 0.56 standard deviations from the centre, half as wide, opacity times 0.9: a third of the deviation from
    /// the parent's falloff.
    Tight,
}

impl SplitProfile {
    /// Shift in standard deviations, factor of the standard deviation, factor of the opacity.
    pub fn factors(self) -> [f64; 3] {
        match self {
            Self::Paper => [1.0, 0.5, 0.606_530_659_712_633],
            Self::Tight => [0.56, 0.5, 0.9],
        }
    }
}

/// Which splats are split (method 6.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Splits {
    /// Candidates that are long enough (paper).
    Long,
    /// With a budget of parameters and `Spending::Gain`, splats of any length, in competition with other growth; otherwise, or
    /// with `need_db`, long candidates.
    Drawn,
}

/// How the budget is spent on candidates (method 6.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Spending {
    /// In the order of error; candidates that are long enough are split, others refined (paper).
    SplitsFirst,
    /// In the order of error per added parameter, with the better of both for each candidate: to be refined, a
    /// large map needs a much larger error than a small one.
    Gain,
}

/// Source of the statistics of a density-control step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StatisticsSource {
    /// The training steps since the last density-control step, at no cost.
    Window,
    /// A pass over all training views.
    Full,
}

/// Settings of density control.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct DensityConfig {
    /// Steps between density-control steps, unless growth is drawn. Default 250 (paper, Contribution- and Area-Aware Geometric
    /// Management).
    pub interval: u32,
    /// First density-control step that uses statistics. Default 500 (authors' configuration; not measured).
    pub start: u32,
    /// Last step after which splats are split and maps refined. Default 15,000 (authors' configuration;
    /// choices 1 and 2).
    pub densify_until: u32,
    /// Step from which texels are trained. Default 1,000 (authors' configuration; not measured).
    pub texture_start: u32,
    /// Growth ends where 10 % more parameters would improve the training views by less than this, dB of PSNR; 0: growth
    /// follows the number of pixels in training and ends with densification (default; the paper).
    pub need_db: f64,
    /// The finished model gives back 10 % of its parameters where that costs the training views less than this, dB of PSNR;
    /// 0: none (the paper). Default 0.05 (method 6.15; choices 17).
    pub give_back_db: f64,
    /// PSNR of the training views that is good enough, dB: where parameters are priced, its error is added to that of the
    /// model. Default 40 (method 6.15; choices 17).
    pub floor_db: f64,
    /// Whether rounds of giving back merge neighbours that lie in one plane. Default on (method 6.16; choices 17).
    pub merge: bool,
    /// Most rounds of giving back, from the end of densification to the last fifth of the steps; two in short runs.
    /// Default 4 (choices 17).
    pub give_back_rounds: u32,
    /// How far growth may exceed a budget of parameters, which giving back then meets. Default 4 (choices 17).
    pub overshoot: f64,
    /// With `need_db`: checks for which a splat is no candidate after growth that did not lower its loss. Default 2 (method
    /// 6.14; choices 17).
    pub rest_checks: u16,
    /// Quantile of the error above which splats are candidates. Default 0.6 (choices 1 and 11; paper: 0.85,
    /// for Tanks & Temples 0.6).
    pub quantile: f64,
    /// What counts as error. Default `mass` (choices 2; paper: `mean`).
    pub error: ErrorMeasure,
    /// Source of the statistics. Default `window`: free (paper: all training views; not measured against it).
    pub statistics: StatisticsSource,
    /// Initial map ceiling, texels per side. Default 2 (paper, Adaptive Per-Gaussian Texture Optimization;
    /// choices 2).
    pub ceiling_start: u16,
    /// Finest texel, in pixels of the nearest camera at the image size of the stage. Default 2 (CAT; choices 1
    /// and 2).
    pub min_texel_px: f64,
    /// Alpha at which maps end. Default 0.25 (choices 1; paper: 1/255).
    pub alpha_texture: f64,
    /// A map is coarsened if that changes its image by less, as a mean weighted by the falloff. Default 0.02
    /// (CAT; choices 2).
    pub coarsen_below: f64,
    /// SH bands of a splat of mean contribution are given back if they change its colour by less, root mean square over
    /// directions; 0: none. Default 0.01 (method 6.13; choices 15; not in the paper).
    pub sh_below: f64,
    /// A splat gains another SH band if its highest one, once judged, changes its colour by this much, measured as for
    /// `sh_below`; 0, or `sh_below` 0: none. Default 0.02 (method 6.13; choices 15).
    pub sh_raise: f64,
    /// Steps for which a band is trained before it is judged. Default 7,000 (choices 15).
    pub sh_trial_steps: u32,
    /// A map is refined along only one axis if its texels vary there more than along the other by this factor, as mean
    /// squared differences between neighbours, and may be coarsened along one axis alone; 0: always along both.
    /// Default 4 (choices 16; not in the paper).
    pub grow_by_axis: f64,
    /// What happens to the moments of a refined map. Default `scaled` (choices 2; paper: `kept`).
    pub growth_moments: GrowthMoments,
    /// Whether maps that are idle, or whose whole support is below the finest texel, are dropped. Default on
    /// (method 6.5; not measured).
    pub untextured: bool,
    /// Halves of a split. Default `tight` (choices 2; paper: `paper`).
    pub split_profile: SplitProfile,
    /// Which splats are split. Default `drawn` (choices 17; paper: `long`).
    pub splits: Splits,
    /// How the budget is spent. Default `gain` (choices 1; paper: `splits-first`).
    pub spending: Spending,
    /// With `gain`: the share of a splat's error that refining its map is expected to remove, over the share
    /// that a split removes. Default 2 (choices 1 and 2).
    pub texel_gain: f64,
    /// Length in finest texels above which splats are split, unless growth is drawn: at step 0, and from step 7,000 on, linear
    /// in between. Default 64 and 16 (CAT, authors' configuration; choices 1 and 2).
    pub split_texels: [f64; 2],
    /// Whether pruned splats are replaced by splits of shorter ones, up to the initial number. Default on
    /// (choices 3; not in the paper).
    pub respawn: bool,
    /// Largest share of splats that a density-control step may add, not counting drawn splits. Default 0.2 (DashGaussian; not
    /// measured).
    pub split_rate: f64,
    /// Sum over the training views of blending weight per pixel below which the prune count rises. Default 5e-6
    /// (paper, Contribution- and Area-Aware Geometric Management; choices 1 and 11).
    pub prune_contribution: f64,
    /// Sum over the training views of the covered share of the image below which the prune count rises. Default
    /// 5e-5 (paper, as above; choices 11).
    pub prune_area: f64,
    /// Patience as steps of the published timetable. Default 2,000 (paper, as above: 8 checks; choices 2 and 11).
    pub patience_steps: u32,
    /// Opacity below which splats fade, unless growth is drawn: at step 0 and at the last, linear in between. Default 0.015 and
    /// 0.04 (authors' code; choices 2).
    pub opacity_floor: [f64; 2],
    /// Opacity below which splats are relocated (policy `plain`), or fade where growth is drawn. Default 0.005 (3DGS-MCMC; not
    /// measured).
    pub relocate_below: f64,
    /// Policy `plain`, and where growth is drawn: steps between density-control steps. Default 100 (3DGS-MCMC; not measured).
    pub relocate_interval: u32,
    /// Policy `plain`: last step after which splats are relocated. Default 20,000 (choices 17; 3DGS-MCMC: 25,000).
    pub relocate_until: u32,
    /// Policy `plain`: `overshoot`. Default 2.5 (choices 17).
    pub relocate_overshoot: f64,
}

impl Default for DensityConfig {
    fn default() -> Self {
        Self {
            interval: 250,
            start: 500,
            densify_until: 15_000,
            texture_start: 1_000,
            need_db: 0.0,
            give_back_db: 0.05,
            floor_db: 40.0,
            merge: true,
            give_back_rounds: 4,
            overshoot: 4.0,
            rest_checks: 2,
            quantile: 0.6,
            error: ErrorMeasure::Mass,
            statistics: StatisticsSource::Window,
            ceiling_start: 2,
            min_texel_px: 2.0,
            alpha_texture: 0.25,
            coarsen_below: 0.02,
            sh_below: 0.01,
            sh_raise: 0.02,
            sh_trial_steps: 7_000,
            grow_by_axis: 4.0,
            growth_moments: GrowthMoments::Scaled,
            untextured: true,
            split_profile: SplitProfile::Tight,
            splits: Splits::Drawn,
            spending: Spending::Gain,
            texel_gain: 2.0,
            split_texels: [64.0, 16.0],
            respawn: true,
            split_rate: 0.2,
            prune_contribution: 5e-6,
            prune_area: 5e-5,
            patience_steps: 2_000,
            opacity_floor: [0.015, 0.04],
            relocate_below: 0.005,
            relocate_interval: 100,
            relocate_until: 20_000,
            relocate_overshoot: 2.5,
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
