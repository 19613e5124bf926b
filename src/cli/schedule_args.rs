//! Arguments of the frequency scheduler.

use super::capture_args::set;
use litetex_gs::console::values::{parse_number, parse_whole};
use litetex_gs::frequency::{FrequencyOptions, ScheduleRules};

/// Flags of the scheduler; settings whose flag is not given are left alone.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Schedule")]
pub struct ScheduleFlags {
    /// Rules of the schedule [default: default]
    #[arg(long, value_name = "NAME")]
    pub rules: Option<RulesArg>,
    /// Step of a run of 30,000 at which the last stage begins [default: 20000; published rules: 15000]
    #[arg(long, value_name = "STEP", value_parser = parse_whole::<u32>)]
    pub until: Option<u32>,
    /// Coarsest render scale [default: 4]
    #[arg(long, value_name = "S", value_parser = parse_number)]
    pub max_scale: Option<f64>,
    /// The first stage keeps 1/BETA of the photos' frequency content [default: 3]
    #[arg(long, value_name = "BETA", value_parser = parse_number)]
    pub beta: Option<f64>,
}

/// [`ScheduleRules`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum RulesArg {
    /// Those that measured best
    Default,
    /// As published
    Paper,
    /// As in the authors' code
    Authors,
}

impl ScheduleFlags {
    /// The settings with what was given.
    pub fn options(&self) -> FrequencyOptions {
        let rules = match self.rules {
            None | Some(RulesArg::Default) => ScheduleRules::Default,
            Some(RulesArg::Paper) => ScheduleRules::Paper,
            Some(RulesArg::Authors) => ScheduleRules::Authors,
        };
        let mut options = FrequencyOptions { rules, until: self.until, ..FrequencyOptions::default() };
        set(&mut options.max_scale, self.max_scale);
        set(&mut options.beta, self.beta);
        options
    }
}
