//! The command line: arguments, messages, progress, the files of a run, exit codes. One file per subcommand; arguments
//! (`*_args`, as typed) are separate from their meaning (`train_job`, `config_file`). No mathematics.

mod asset_args;
mod bench;
mod bench_kernels;
mod capture;
mod capture_args;
mod chart;
mod colour_by;
mod common_args;
mod compare;
mod completions;
mod config_file;
mod curve;
mod devices;
mod eval;
mod evaluations;
mod export;
mod extra_figures;
mod init_source;
mod inspect;
mod interrupt;
mod lab;
mod live_view;
mod log;
mod man;
mod memory;
mod metrics_tail;
mod orphan;
mod outlying;
mod outputs;
mod profile;
mod progress;
mod quickstart;
mod regions;
mod render;
mod resource_estimate;
mod run_folder;
mod sample;
mod schedule;
mod schedule_args;
mod schedule_chart;
mod schedule_report;
mod selftest;
mod sequence;
mod session;
mod sources;
mod stamp;
mod summary;
mod table;
#[cfg(test)]
mod tests;
mod train;
mod train_args;
mod train_job;
mod train_summary;
mod training_views;
mod uncovered;
mod validate;
mod values;
mod verify;
mod view;
mod view_files;
mod view_photos;
mod view_run;
mod view_scene;
mod views_progress;
mod worst_view;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use litetex_gs::Error;
use log::Log;
use std::path::Path;
use std::process::ExitCode;

/// Trains textured 2D Gaussian splats from photos with poses.
#[derive(Parser)]
#[command(
    name = "litetex",
    version,
    max_term_width = 110,
    after_help = "Start with \"litetex quickstart\". Exit codes: 0 success, 1 failed check, 2 usage error, 3 \
                  invalid input, 4 unsupported, 5 device or run-time failure, 130 interrupted."
)]
struct Cli {
    #[command(flatten)]
    common: common_args::CommonArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Train(Box<train_args::TrainArgs>),
    Eval(eval::EvalArgs),
    Render(render::RenderArgs),
    Sample(sample::SampleArgs),
    Export(Box<export::ExportArgs>),
    Convert(Box<export::ConvertArgs>),
    Verify(verify::VerifyArgs),
    Validate(validate::ValidateArgs),
    Compare(compare::CompareArgs),
    Inspect(inspect::InspectArgs),
    View(view::ViewArgs),
    Schedule(schedule::ScheduleArgs),
    Devices(devices::DevicesArgs),
    Selftest(selftest::SelftestArgs),
    Bench(bench::BenchArgs),
    Chart(chart::ChartArgs),
    BenchKernels(bench_kernels::BenchKernelsArgs),
    Quickstart(quickstart::QuickstartArgs),
    Completions(completions::CompletionsArgs),
    Man(man::ManArgs),
}

/// The program's command line. Options take "-1" as a value, so that each option's parser rejects it with its own message.
fn command() -> clap::Command {
    fn take_negative_numbers(command: clap::Command) -> clap::Command {
        command
            .mut_args(|arg| match arg.get_action().takes_values() && !arg.is_positional() {
                true => arg.allow_negative_numbers(true),
                false => arg,
            })
            .mut_subcommands(take_negative_numbers)
    }
    take_negative_numbers(Cli::command())
}

/// Drops the tip to pass an unknown option as a value (`-- --seed`), unless there is a file of that name to pass.
fn without_useless_tip(mut error: clap::Error) -> clap::Error {
    let is_file =
        |name: &ContextValue| matches!(name, ContextValue::String(name) if Path::new(name).exists());
    if error.kind() == ErrorKind::UnknownArgument && !error.get(ContextKind::InvalidArg).is_some_and(is_file)
    {
        error.remove(ContextKind::Suggested);
    }
    error
}

/// Parses the arguments, runs the command and returns the exit code of its error's family.
pub fn main() -> ExitCode {
    let cli = match command().try_get_matches().and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        // Help and version arrive here too; clap knows their stream.
        Err(e) => {
            let code = if e.use_stderr() { 2 } else { 0 };
            let _ = without_useless_tip(e).print();
            return ExitCode::from(code);
        }
    };
    let log = Log::new(cli.common.log_format, cli.common.quiet, cli.common.verbose);
    match run(cli, &log) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) if exit_code(&error) == 130 => {
            // The command has said where to continue.
            log.detail("interrupted");
            ExitCode::from(130)
        }
        Err(error) => {
            log.error(&format!("{error:#}"));
            ExitCode::from(exit_code(&error))
        }
    }
}

fn run(cli: Cli, log: &Log) -> anyhow::Result<()> {
    if let Some(threads) = cli.common.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .map_err(|e| Error::Device(format!("--threads {threads}: {e}")))?;
    }
    let threads = cli.common.threads;
    match cli.command {
        Command::Train(args) => train::run(*args, log),
        Command::Eval(args) => eval::run(&args, log),
        Command::Render(args) => render::run(&args, log),
        Command::Sample(args) => sample::run(&args, log),
        Command::Export(args) => export::run(&args, log),
        Command::Convert(args) => export::convert(&args, log),
        Command::Verify(args) => verify::run(&args, log),
        Command::Validate(args) => validate::run(&args),
        Command::Compare(args) => compare::run(&args, log),
        Command::Inspect(args) => inspect::run(&args, log),
        Command::View(args) => view::run(&args, log),
        Command::Schedule(args) => schedule::run(&args, log),
        Command::Devices(args) => devices::run(&args),
        Command::Selftest(args) => selftest::run(&args, log),
        Command::Bench(args) => bench::run(&args, threads, log),
        Command::Chart(args) => chart::run(&args, log),
        Command::BenchKernels(args) => bench_kernels::run(&args, log),
        Command::Quickstart(args) => quickstart::run(&args, log),
        Command::Completions(args) => completions::run(&args, Cli::command()),
        Command::Man(args) => man::run(&args, Cli::command()),
    }
}

/// Exit code of the first error in the chain that has one; 5 if none has.
fn exit_code(error: &anyhow::Error) -> u8 {
    error.chain().find_map(|e| e.downcast_ref::<Error>()).map_or(5, Error::exit_code)
}

/// Whether the reader closed the pipe, as `head` does, which is not a failure.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|e| {
        let io = match e.downcast_ref::<Error>() {
            Some(Error::Io { cause, .. }) => Some(cause),
            _ => e.downcast_ref::<std::io::Error>(),
        };
        io.is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
    })
}
