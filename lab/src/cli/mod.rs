//! The command line of the laboratory: one file per subcommand. Trainings, captures and exports are made by the program
//! `litetex`, in processes of their own.

mod bench;
mod bench_kernels;
mod chart;
mod figures;
mod litetex;
mod regions;
mod schedule_chart;

use clap::{Parser, Subcommand};
use litetex_gs::Result;
use litetex_gs::console::{CommonArgs, Log, Output, Program, enter};
use std::process::ExitCode;

/// Compares trainings of litetex: benchmarks, their charts, and what a run and a GPU are measured by
#[derive(Parser)]
#[command(
    name = "litetex-lab",
    version,
    max_term_width = 110,
    after_help = "Exit codes are those of litetex: 0 success, 1 failed check, 2 usage error, 3 invalid input, \
                  4 unsupported, 5 device or run-time failure, 130 interrupted."
)]
struct Cli {
    #[command(flatten)]
    common: CommonArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Bench(bench::BenchArgs),
    Chart(chart::ChartArgs),
    Figures(figures::FiguresArgs),
    ScheduleChart(schedule_chart::ScheduleChartArgs),
    BenchKernels(bench_kernels::BenchKernelsArgs),
}

impl Program for Cli {
    fn common(&self) -> &CommonArgs {
        &self.common
    }

    fn run(self, log: &Log) -> Result<Output> {
        match self.command {
            Command::Bench(args) => bench::run(&args, self.common.threads, log),
            Command::Chart(args) => chart::run(&args, log),
            Command::Figures(args) => figures::run(&args, log),
            Command::ScheduleChart(args) => schedule_chart::run(&args, log),
            Command::BenchKernels(args) => bench_kernels::run(&args, log),
        }
    }
}

/// Runs the program.
pub fn main() -> ExitCode {
    enter::<Cli>()
}
