//! Arguments of the frequency scheduler.

use super::capture_args::set;
use litetex_gs::console::values::{parse_number, parse_whole};
use litetex_gs::frequency::{CapRule, FrequencyOptions, ScaleRule};

/// Flags of the scheduler; settings whose flag is not given are left alone.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Schedule")]
pub struct ScheduleFlags {
    /// How the render scale follows the schedule [default: fractional]
    #[arg(long, value_name = "RULE")]
    pub scale_rule: Option<ScaleRuleArg>,
    /// How the texture cap follows the schedule [default: squared]
    #[arg(long, value_name = "RULE")]
    pub cap_rule: Option<CapRuleArg>,
    /// Step of a run of 30,000 at which the last stage begins [default: 20000]
    #[arg(long, value_name = "STEP", value_parser = parse_whole::<u32>)]
    pub until: Option<u32>,
    /// Coarsest render scale [default: 4]
    #[arg(long, value_name = "S", value_parser = parse_number)]
    pub max_scale: Option<f64>,
    /// The first stage keeps 1/BETA of the photos' frequency content [default: 3]
    #[arg(long, value_name = "BETA", value_parser = parse_number)]
    pub beta: Option<f64>,
    /// Count white noise as detail, as published, instead of subtracting it first
    #[arg(long)]
    pub keep_noise: bool,
}

/// [`ScaleRule`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ScaleRuleArg {
    /// Always full size
    Off,
    /// Rounded down to an integer
    Integer,
    /// Rounded down to a power of 2^(1/4)
    Fractional,
}

/// [`CapRule`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum CapRuleArg {
    /// Texels per splat follow pixels per view
    Squared,
    /// As in the authors' code
    Authors,
}

impl ScheduleFlags {
    /// Writes what was given over `options`.
    pub fn apply(&self, options: &mut FrequencyOptions) {
        set(&mut options.scale_rule, self.scale_rule.map(ScaleRule::from));
        set(&mut options.cap_rule, self.cap_rule.map(CapRule::from));
        set(&mut options.until, self.until);
        set(&mut options.max_scale, self.max_scale);
        set(&mut options.beta, self.beta);
        options.noise_robust &= !self.keep_noise;
    }
}

impl From<ScaleRuleArg> for ScaleRule {
    fn from(typed: ScaleRuleArg) -> Self {
        match typed {
            ScaleRuleArg::Off => Self::Off,
            ScaleRuleArg::Integer => Self::Integer,
            ScaleRuleArg::Fractional => Self::Fractional,
        }
    }
}

impl From<CapRuleArg> for CapRule {
    fn from(typed: CapRuleArg) -> Self {
        match typed {
            CapRuleArg::Squared => Self::Squared,
            CapRuleArg::Authors => Self::Authors,
        }
    }
}
