//! Options of every subcommand.

use super::log::LogFormat;
use super::values::whole;

/// Options of every subcommand.
#[derive(clap::Args)]
pub struct CommonArgs {
    /// Print only warnings and errors
    #[arg(long, short, global = true, help_heading = "Messages")]
    pub quiet: bool,
    /// Print more
    #[arg(long, short, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet", help_heading = "Messages")]
    pub verbose: u8,
    /// Format of the messages on standard error
    #[arg(long, global = true, value_name = "FORM", default_value = "text", help_heading = "Messages")]
    pub log_format: LogFormat,
    /// Number of worker threads; does not affect the results [default: one per core]
    #[arg(long, global = true, value_name = "N", value_parser = whole::<u16>(1..=1024), help_heading = "Device")]
    pub threads: Option<u16>,
    /// Print the report as JSON
    #[arg(long, global = true, help_heading = "Messages")]
    pub json: bool,
    /// Parse the arguments and end: "litetex-lab bench" asks this way whether those of a matrix are right
    #[arg(long, global = true, hide = true)]
    pub parse_only: bool,
}
