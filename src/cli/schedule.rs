//! `litetex schedule`: the frequency schedule of a capture, as tables, JSON or a chart.

use super::capture;
use super::capture_args::CaptureArgs;
use super::log::Log;
use super::outputs;
use super::schedule_args::ScheduleFlags;
use super::schedule_chart;
use super::schedule_report::ScheduleReport;
use super::table::print_json;
use litetex_gs::atomic_file;
use litetex_gs::frequency::FrequencyOptions;
use std::path::PathBuf;

/// Show how image sizes and texture caps rise during training
///
/// Analyses the frequencies of the training photos and lists the stages that follow: which steps render at
/// which scale, the texture cap of each, and how the work is distributed. Nothing is trained.
#[derive(clap::Args)]
pub struct ScheduleArgs {
    /// Folder of the capture
    capture: PathBuf,
    /// Steps of the training; the schedule ends after two thirds of them
    #[arg(long, visible_alias = "iterations", value_name = "N", default_value_t = 30_000, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Also write a chart as SVG
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Replace the chart if it exists
    #[arg(long, requires = "svg")]
    force: bool,
    #[command(flatten)]
    schedule_flags: ScheduleFlags,
    #[command(flatten)]
    capture_args: CaptureArgs,
}

/// Analyses and prints.
pub fn run(args: &ScheduleArgs, log: &Log) -> anyhow::Result<()> {
    if let Some(svg) = &args.svg {
        // Before the work, not after it.
        outputs::check_free(std::slice::from_ref(svg), args.force)?;
    }
    let mut load = capture::LoadOptions::default();
    args.capture_args.apply(&mut load);
    let mut options = FrequencyOptions::default();
    args.schedule_flags.apply(&mut options);
    options.check()?;
    let capture = capture::open(&args.capture, &load)?;
    log.report(&capture.report);
    let report = ScheduleReport::new(&args.capture, &capture, args.steps, options)?;
    if let Some(svg) = &args.svg {
        atomic_file::write(svg, schedule_chart::svg(&report).as_bytes())?;
        log.info(&format!("wrote {}", svg.display()));
    }
    let printed = if args.json { print_json(&report) } else { report.print() };
    Ok(printed?)
}
