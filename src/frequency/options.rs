//! Settings of the frequency schedule. Each default names its source, as in `TrainConfig`.

use crate::Result;
use serde::{Deserialize, Serialize};

/// How the render scale follows from the continuous scale s(t) (method 7.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScaleRule {
    /// Always full size.
    Off,
    /// Rounded down to an integer (paper).
    Integer,
    /// Rounded down to a power of 2^(1/4), which gives nine sizes from full to a quarter, few enough to keep the
    /// reduced photos.
    #[default]
    Fractional,
}

/// How the texture cap follows from the continuous scale s(t) (method 7.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CapRule {
    /// The power of two below 256 / s^2, 4 to 256: texels per splat follow pixels per view.
    #[default]
    Squared,
    /// 256 / ceil(s), rounded down, with s linear between the stages (authors' code).
    Authors,
}

/// Which spectra the scale of the first stage follows from (method 7.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StartRule {
    /// Those of the views, each by itself: a quantile of their scales.
    #[default]
    Quantile,
    /// Their mean (paper).
    Mean,
}

/// Settings of the frequency schedule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct FrequencyOptions {
    /// The first stage shows 1 / beta of the significance. Default 3 (paper, Frequency-Aware Scheduling; method 7.2).
    pub beta: f64,
    /// Largest render scale, s_cfg. Default 4 (paper, Frequency-Aware Scheduling).
    pub max_scale: f64,
    /// Step of the published timetable at which the last stage begins. Default 20,000 (method 7.2; paper: the end of
    /// densification, 15,000).
    pub until: u32,
    /// Number of stages, L. Default 32 (paper, Frequency-Aware Scheduling).
    pub levels: usize,
    /// Which spectra the first scale follows from. Default `quantile` (method 7.2; paper: `mean`).
    pub start_rule: StartRule,
    /// Quantile over views of the scales at which each view alone would start. Default 0.1 (method 7.2; authors'
    /// code: 0, the minimum, by which one noisy photo decides for all).
    pub quantile: f64,
    /// Largest number of training views that are analysed, evenly picked. Default 50 (bounds the cost; not measured).
    pub max_views: usize,
    /// Whether white noise is removed from the spectra. Default on (method 7.3; not in the paper).
    pub noise_robust: bool,
    /// How the render scale follows. Default `fractional` (method 7.4; paper: `integer`).
    pub scale_rule: ScaleRule,
    /// How the texture cap follows. Default `squared` (method 7.4; not measured; authors' code: `authors`).
    pub cap_rule: CapRule,
}

impl Default for FrequencyOptions {
    fn default() -> Self {
        Self {
            beta: 3.0,
            max_scale: 4.0,
            until: 20_000,
            levels: 32,
            start_rule: StartRule::default(),
            quantile: 0.10,
            max_views: 50,
            noise_robust: true,
            scale_rule: ScaleRule::default(),
            cap_rule: CapRule::default(),
        }
    }
}

impl FrequencyOptions {
    /// The published settings, without our correction of the spectrum.
    pub fn paper() -> Self {
        Self {
            until: 15_000,
            start_rule: StartRule::Mean,
            noise_robust: false,
            scale_rule: ScaleRule::Integer,
            ..Self::default()
        }
    }

    /// Checks that all settings are in range.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] naming the setting, what was found and what was expected.
    pub fn check(&self) -> Result<()> {
        let complain = |name: &str, found: &dyn std::fmt::Display, expected: &str| {
            Err(usage!("scheduler.{name}: found {found}, expected {expected}"))
        };
        if !(self.beta > 1.0 && self.beta <= 1e6) {
            return complain("beta", &self.beta, "more than 1 and at most 1e6");
        }
        if !(1.0..=64.0).contains(&self.max_scale) {
            return complain("max-scale", &self.max_scale, "1 to 64");
        }
        if !(1..=30_000).contains(&self.until) {
            return complain("until", &self.until, "1 to 30000");
        }
        if !(2..=1024).contains(&self.levels) {
            return complain("levels", &self.levels, "2 to 1024");
        }
        if !(0.0..=1.0).contains(&self.quantile) {
            return complain("quantile", &self.quantile, "0 to 1");
        }
        if self.max_views == 0 {
            return complain("max-views", &self.max_views, "at least 1");
        }
        Ok(())
    }
}
