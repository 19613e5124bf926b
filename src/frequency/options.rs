//! Settings of the frequency schedule. Each default names its source, as in `TrainConfig`.

use crate::Result;
use serde::{Deserialize, Serialize};

/// The rules that a schedule follows; each a set of constants (method 7).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScheduleRules {
    /// Those that measured best.
    #[default]
    Default,
    /// As published.
    Paper,
    /// As in the authors' code.
    Authors,
}

impl ScheduleRules {
    /// What they set.
    pub fn set(self) -> RuleSet {
        // Method 7.2 to 7.4; removing noise is not in the paper. The cap is not measured.
        let default = RuleSet {
            start: StartRule::Quantile(0.1),
            removes_noise: true,
            scale: ScaleRule::Fractional,
            cap: CapRule::Squared,
            until: 20_000,
        };
        let paper = RuleSet {
            start: StartRule::Mean,
            removes_noise: false,
            scale: ScaleRule::Integer,
            cap: CapRule::Squared,
            // The end of densification.
            until: 15_000,
        };
        match self {
            Self::Default => default,
            Self::Paper => paper,
            // The minimum, by which one noisy photo decides for all.
            Self::Authors => RuleSet { start: StartRule::Quantile(0.0), cap: CapRule::Authors, ..paper },
        }
    }
}

/// What [`ScheduleRules`] set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuleSet {
    /// Which spectra the scale of the first stage follows from.
    pub start: StartRule,
    /// Whether white noise is removed from the spectra (method 7.3).
    pub removes_noise: bool,
    /// How the render scale follows from the continuous scale.
    pub scale: ScaleRule,
    /// How the texture cap follows from the continuous scale.
    pub cap: CapRule,
    /// Step of the published timetable at which the last stage begins.
    pub until: u32,
}

/// How the render scale follows from the continuous scale s(t) (method 7.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScaleRule {
    /// Rounded down to an integer (paper).
    Integer,
    /// Rounded down to a power of 2^(1/4), which gives nine sizes from full to a quarter, few enough to keep the
    /// reduced photos.
    Fractional,
}

/// How the texture cap follows from the continuous scale s(t) (method 7.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CapRule {
    /// The power of two below 256 / s^2, 4 to 256: texels per splat follow pixels per view.
    Squared,
    /// 256 / ceil(s), rounded down, with s linear between the stages (authors' code).
    Authors,
}

/// Which spectra the scale of the first stage follows from (method 7.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartRule {
    /// Those of the views, each by itself: this quantile of the scales at which each view alone would start.
    Quantile(f64),
    /// Their mean (paper).
    Mean,
}

/// Number of stages, L (paper, Frequency-Aware Scheduling).
pub(super) const LEVELS: usize = 32;

/// Largest number of training views that are analysed, evenly picked. Bounds the cost; not measured.
pub(super) const MAX_VIEWS: usize = 50;

/// Largest number of their pixels together: as many views of the default size as may be analysed, and fewer of larger photos, but
/// [`LEAST_VIEWS`]. 10 of the 43 views of fox, at 270 x 480, begin their stages at most 1 % later than all of them.
pub(super) const MAX_PIXELS: usize = MAX_VIEWS * 1_600 * 1_600;
pub(super) const LEAST_VIEWS: usize = 8;

/// Settings of the frequency schedule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct FrequencyOptions {
    /// The first stage shows 1 / beta of the significance. Default 3 (paper, Frequency-Aware Scheduling; method 7.2).
    pub beta: f64,
    /// Largest render scale, s_cfg. Default 4 (paper, Frequency-Aware Scheduling).
    pub max_scale: f64,
    /// Step of the published timetable at which the last stage begins. Default: what the rules say (method 7.2).
    pub until: Option<u32>,
    /// The rules that it follows. Default `default` (method 7).
    pub rules: ScheduleRules,
}

impl Default for FrequencyOptions {
    fn default() -> Self {
        Self { beta: 3.0, max_scale: 4.0, until: None, rules: ScheduleRules::Default }
    }
}

impl FrequencyOptions {
    /// Step of the published timetable at which the last stage begins.
    pub fn until(&self) -> u32 {
        self.until.unwrap_or(self.rules.set().until)
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
        if !(1..=30_000).contains(&self.until()) {
            return complain("until", &self.until(), "1 to 30000");
        }
        Ok(())
    }
}
