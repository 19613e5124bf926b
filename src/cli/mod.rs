//! The command line: one file per subcommand, progress, previews. Arguments (`*_args`, as typed) are separate from their
//! meaning (`train_job`). No mathematics.

mod asset_args;
mod batch;
mod capture;
mod capture_args;
mod colour_by;
mod compare;
mod completions;
mod curve;
mod devices;
mod eval;
mod export;
mod export_files;
mod exported;
mod inspect;
mod live_view;
mod man;
mod metrics_tail;
mod origin;
mod orphan;
mod outputs;
mod progress;
mod quickstart;
mod render;
mod report;
mod report_figures;
mod report_views;
mod sample;
mod scale_from;
mod schedule;
mod schedule_args;
mod schedule_report;
mod selftest;
mod session;
mod sources;
mod stamp;
#[cfg(test)]
mod tests;
mod train;
mod train_args;
mod train_job;
mod train_plan;
mod train_summary;
mod training_values;
mod uncovered;
mod validate;
mod verify;
mod view;
mod view_photos;
mod view_run;
mod view_scene;
mod views_progress;
mod worst_view;

use clap::{CommandFactory as _, Parser, Subcommand};
use litetex_gs::Result;
use litetex_gs::console::{CommonArgs, Log, Output, Program, enter};
use std::process::ExitCode;

/// Trains textured 2D Gaussian splats from photos with poses.
#[derive(Parser)]
#[command(
    name = "litetex",
    version,
    max_term_width = 110,
    after_help = "Start with \"litetex quickstart\". Exit codes: 0 success, 1 failed check, 2 usage error, 3 \
                  invalid input, 4 unsupported, 5 device or run-time failure, 130 interrupted. docs/troubleshooting.md explains \
                  warning[NAME] and error[NAME]."
)]
struct Cli {
    #[command(flatten)]
    common: CommonArgs,
    /// The capture that a process of "litetex train A B C" trains, from 0
    #[arg(long, hide = true)]
    nth: Option<usize>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Train(Box<train_args::TrainArgs>),
    Eval(eval::EvalArgs),
    Render(render::RenderArgs),
    Capture(capture::CaptureArgs),
    Sample(sample::SampleArgs),
    #[command(visible_alias = "convert")]
    Export(Box<export::ExportArgs>),
    Verify(verify::VerifyArgs),
    Validate(validate::ValidateArgs),
    Compare(compare::CompareArgs),
    Inspect(inspect::InspectArgs),
    View(view::ViewArgs),
    Report(report::ReportArgs),
    Schedule(schedule::ScheduleArgs),
    /// List the devices that can train and render
    Devices,
    Selftest(selftest::SelftestArgs),
    Quickstart(quickstart::QuickstartArgs),
    Completions(completions::CompletionsArgs),
    Man(man::ManArgs),
}

impl Program for Cli {
    const TIPS: &'static [(&'static str, &'static str)] = &[
        ("--max-time", "the time of a training is set with '--time 10m'"),
        ("--profile", "profiles are sets of settings; a shorter training is '--time 2m'"),
    ];

    fn common(&self) -> &CommonArgs {
        &self.common
    }

    fn check_single(&self) -> Result<()> {
        match &self.command {
            Command::Train(args) => batch::check_single(args),
            _ => Ok(()),
        }
    }

    fn run(self, log: &Log) -> Result<Output> {
        match self.command {
            Command::Train(args) => train::run(*args, self.nth, log),
            Command::Eval(args) => eval::run(&args, log),
            Command::Render(args) => render::run(&args, log),
            Command::Capture(args) => capture::run(&args, log),
            Command::Sample(args) => sample::run(&args, log),
            Command::Export(args) => export::run(&args, log),
            Command::Verify(args) => verify::run(&args, log),
            Command::Validate(args) => validate::run(&args),
            Command::Compare(args) => compare::run(&args, log),
            Command::Inspect(args) => inspect::run(&args, log),
            Command::View(args) => view::run(&args, log),
            Command::Report(args) => report::run(&args, log),
            Command::Schedule(args) => schedule::run(&args, log),
            Command::Devices => devices::run(),
            Command::Selftest(args) => selftest::run(&args, log),
            Command::Quickstart(args) => quickstart::run(&args, log),
            Command::Completions(args) => completions::run(&args, Cli::command()),
            Command::Man(args) => man::run(&args, Cli::command()),
        }
    }
}

/// Runs the program.
pub fn main() -> ExitCode {
    enter::<Cli>()
}
