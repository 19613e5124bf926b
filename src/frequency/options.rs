//! Settings of the frequency scheduler, with defaults and their sources.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// How the render scale follows the continuous scale s(t).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScaleRule {
    /// Always full size.
    Off,
    /// Rounded down to an integer (paper; method section 8.2).
    Integer,
    /// Rounded down to a power of 2^(1/4), so that reduced photos can be kept: nine sizes between full
    /// and a quarter (method section 8.3).
    #[default]
    Fractional,
}

/// How the cap of the texture resolution follows the continuous scale s(t) (method section 8.6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CapRule {
    /// The power of two below 256 / s^2, 4 to 256: texels per primitive follow pixels per view.
    #[default]
    Squared,
    /// 256 / ceil(s), rounded down, with s linear between the stages: the authors' code.
    Authors,
}

/// Settings of the frequency scheduler.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct FrequencyOptions {
    /// The first stage sees this part of the significance: 1 / beta (paper: 3).
    pub beta: f64,
    /// Coarsest render scale (paper: s_cfg = 4).
    pub max_scale: f64,
    /// The last stage begins at this step of the published timetable (paper: at the end of densification).
    pub until: u32,
    /// Number of stages (paper: L = 32).
    pub levels: usize,
    /// Quantile over single views of the scale at which each of them would start. 0 is the published
    /// minimum, with which one noisy photo decides for all (method section 8.2).
    pub quantile: f64,
    /// At most this many training views are analysed, evenly picked (method section 8.1).
    pub max_views: usize,
    /// Whether the amplitude of white noise is taken out first: see `schedule::noise`. Ours; off in the
    /// paper's profile.
    pub noise_robust: bool,
    /// How the render scale follows.
    pub scale_rule: ScaleRule,
    /// How the cap of the texture resolution follows.
    pub cap_rule: CapRule,
}

impl Default for FrequencyOptions {
    fn default() -> Self {
        Self {
            beta: 3.0,
            max_scale: 4.0,
            until: 20_000,
            levels: 32,
            quantile: 0.10,
            max_views: 50,
            noise_robust: true,
            scale_rule: ScaleRule::default(),
            cap_rule: CapRule::default(),
        }
    }
}

impl FrequencyOptions {
    /// The published constants, without our corrections of the spectrum.
    pub fn paper() -> Self {
        Self { until: 15_000, noise_robust: false, scale_rule: ScaleRule::Integer, ..Self::default() }
    }

    /// Checks that the numbers make sense.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the setting.
    pub fn check(&self) -> Result<()> {
        let complain = |name: &str, found: &dyn std::fmt::Display, expected: &str| {
            Err(Error::Usage(format!("schedule: {name} is {found}, expected {expected}")))
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
