//! Settings of the density-control steps: who gets texels, who is split, who goes. All times are those of the
//! published timetable of 30,000 steps; [`Schedule`](crate::train::Schedule) scales them to the run.

use crate::backend::DeviceLimits;
use crate::model::num_params;
use serde::{Deserialize, Serialize};

/// Parts of the method that can be switched off one by one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Components {
    /// Frequency-aware scheduler: size of the images, cap of the maps and pace of the splits follow from
    /// the photos' spectra. Off: full size, cap 256, splits limited to 20 % a step alone.
    pub scheduler: bool,
    /// Removal of splats that contribute or cover too little for several checks in a row.
    pub pruning: bool,
    /// Personal ceilings that start low and double with error. Off: maps get finer with error alone.
    pub growth: bool,
    /// Resolution-aware rates of the texels.
    pub update_rule: bool,
    /// Splitting along the axes.
    pub splitting: bool,
    /// Down-scaling of maps that lose nothing by it.
    pub coarsening: bool,
}

impl Components {
    /// Names, in the order of the fields.
    pub const NAMES: [&str; 6] = ["scheduler", "pruning", "growth", "update-rule", "splitting", "coarsening"];

    /// The switch of a name.
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

/// What counts as a splat's error (method section 9.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ErrorMeasure {
    /// Loss per unit of contribution: independent of the splat's size (paper).
    Mean,
    /// Loss that the splat carries in a view: grows with its size.
    Mass,
}

/// What becomes of the moments of a map whose texels were doubled (method section 4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GrowthMoments {
    /// Scaled as the gradients are: first by 1/4, second by 1/16.
    Scaled,
    /// As they were (paper).
    Kept,
    /// Zero: an accidental warm restart (authors' code).
    Zero,
}

impl GrowthMoments {
    /// Factors of first and second moments.
    pub fn scale(self) -> [f32; 2] {
        match self {
            Self::Scaled => [1.0 / 4.0, 1.0 / 16.0],
            Self::Kept => [1.0, 1.0],
            Self::Zero => [0.0, 0.0],
        }
    }
}

/// Where the children of a split go and how large they are (method section 6.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SplitProfile {
    /// One standard deviation apart from the centre, half as wide, opacity times exp(-1/2) (paper).
    Paper,
    /// 0.56 standard deviations, half as wide, opacity times 0.9: a third of the error of the profile.
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

/// What the budget is spent on, and who comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Spending {
    /// By error; a splat that is long enough is split, others get finer maps (paper).
    SplitsFirst,
    /// By error per parameter that is added, for each candidate the better of both: a large map has to be
    /// much worse than a small one to get four times its texels.
    Gain,
}

/// Where the statistics of a density-control step come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StatisticsSource {
    /// The training steps since the last one: costs nothing.
    Window,
    /// A pass over all training views.
    Full,
}

/// Settings of the density-control steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct DensityConfig {
    /// Steps between density-control steps.
    pub interval: u32,
    /// First density-control step.
    pub start: u32,
    /// Splitting and growth of maps end here.
    pub densify_until: u32,
    /// Texels are trained from here on.
    pub texture_start: u32,
    /// Share of the splats, by error, that are not candidates for growth and splits.
    pub quantile: f64,
    /// What counts as error.
    pub error: ErrorMeasure,
    /// Where it is measured.
    pub statistics: StatisticsSource,
    /// Personal ceiling of a map at the start, texels a side.
    pub ceiling_start: u16,
    /// Finest texel, in pixels of the nearest camera at the current size of the images.
    pub min_texel_px: f64,
    /// Maps end where alpha falls to this.
    pub alpha_texture: f64,
    /// A map is halved if that changes its image by less (mean over its falloff).
    pub coarsen_below: f64,
    /// What becomes of the moments when texels are doubled.
    pub growth_moments: GrowthMoments,
    /// Splats whose whole support is below the finest texel have no map.
    pub untextured: bool,
    /// Children of a split.
    pub split_profile: SplitProfile,
    /// Splits or texels.
    pub spending: Spending,
    /// With `gain`: the part of a splat's error that a finer map is expected to remove, over the part that
    /// a split removes.
    pub texel_gain: f64,
    /// Splats of more texels a side than this may be split: at the start, and from 7,000 steps on.
    pub split_texels: [f64; 2],
    /// Splats that were removed are made up for by splits of shorter ones, as many as there were at the start.
    pub respawn: bool,
    /// Splats grow by at most this share in a density-control step.
    pub split_rate: f64,
    /// Sum over the training views of blending weight per pixel below which a splat is marked.
    pub prune_contribution: f64,
    /// Sum over the training views of covered share of the image below which a splat is marked.
    pub prune_area: f64,
    /// Steps of the published timetable for which a splat must stay marked to be removed.
    pub patience_steps: u32,
    /// Less opaque splats are removed: threshold at the start and at the end, linear in between.
    pub opacity_floor: [f64; 2],
    /// Policy `plain`: splats less opaque than this are moved to where others are opaque.
    pub relocate_below: f64,
    /// Policy `plain`: steps between relocations.
    pub relocate_interval: u32,
    /// Policy `plain`: relocation ends here.
    pub relocate_until: u32,
}

impl Default for DensityConfig {
    fn default() -> Self {
        Self {
            interval: 250,
            start: 500,
            densify_until: 15_000,
            texture_start: 1_000,
            quantile: 0.6,
            error: ErrorMeasure::Mass,
            statistics: StatisticsSource::Window,
            ceiling_start: 2,
            min_texel_px: 2.0,
            alpha_texture: 0.25,
            coarsen_below: 0.02,
            growth_moments: GrowthMoments::Scaled,
            untextured: true,
            split_profile: SplitProfile::Tight,
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
            relocate_until: 25_000,
        }
    }
}

/// Largest model that a run may make; `None`: no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct Budget {
    /// Splats.
    pub max_splats: Option<usize>,
    /// Texels over all maps.
    pub max_texels: Option<usize>,
    /// Parameters: 59 a splat and 3 a texel.
    pub max_params: Option<usize>,
}

impl Budget {
    /// Whether a model of this size is within it.
    pub fn allows(&self, num_splats: usize, num_texels: usize) -> bool {
        self.max_splats.is_none_or(|most| num_splats <= most)
            && self.max_texels.is_none_or(|most| num_texels <= most)
            && self.max_params.is_none_or(|most| num_params(num_splats, num_texels) <= most)
    }

    /// The part of it that may be used at a share of the time to the end of densification: rises evenly from
    /// the size at the start (splats, texels), so that capacity is left for what only the full images
    /// show; what there is `now` is not taken back.
    pub fn paced(&self, share: f64, start: [usize; 2], now: [usize; 2]) -> Self {
        let params = |[splats, texels]: [usize; 2]| num_params(splats, texels);
        let part = |most: Option<usize>, start: usize, now: usize| {
            let paced = |most: usize| start + (most.saturating_sub(start) as f64 * share) as usize;
            most.map(|most| paced(most).max(now).min(most))
        };
        Self {
            max_splats: part(self.max_splats, start[0], now[0]),
            max_texels: part(self.max_texels, start[1], now[1]),
            max_params: part(self.max_params, params(start), params(now)),
        }
    }

    /// This budget on a device that holds no more than so much: what is not bounded by it is by the device.
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

    /// Most splats of a number of texels each that fit.
    pub fn most_splats(&self, texels_each: usize) -> usize {
        let by = |most: Option<usize>, each: usize| most.map_or(usize::MAX, |m| m / each.max(1));
        let texels = if texels_each == 0 { usize::MAX } else { by(self.max_texels, texels_each) };
        by(self.max_splats, 1).min(texels).min(by(self.max_params, num_params(1, texels_each)))
    }
}
