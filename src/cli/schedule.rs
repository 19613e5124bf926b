//! `litetex schedule`: the frequency schedule of a capture, as tables or JSON.

use super::capture_args::WholeCaptureArgs;
use super::schedule_args::ScheduleFlags;
use super::schedule_report::ScheduleReport;
use litetex_gs::Result;
use litetex_gs::capture::{Capture, LoadOptions};
use litetex_gs::console::values::whole;
use litetex_gs::console::{Log, Output};
use serde_json::json;
use std::path::PathBuf;

/// Show how image sizes and texture caps rise during training
///
/// Analyses the frequencies of the training photos and lists the stages that follow: which steps render at
/// which scale, the texture cap of each, and how the work is distributed. Nothing is trained.
#[derive(clap::Args)]
pub struct ScheduleArgs {
    /// Folder of the capture
    capture: PathBuf,
    /// Steps of the training; the schedule ends after two thirds of them (published rules: half)
    #[arg(long, visible_alias = "iterations", value_name = "N", default_value_t = 30_000, value_parser = whole::<u32>(1..=u64::MAX))]
    steps: u32,
    #[command(flatten)]
    schedule_flags: ScheduleFlags,
    #[command(flatten)]
    capture_args: WholeCaptureArgs,
}

/// Analyses and prints.
pub fn run(args: &ScheduleArgs, log: &Log) -> Result<Output> {
    let mut load = LoadOptions::default();
    args.capture_args.apply(&mut load);
    let options = args.schedule_flags.options();
    options.check()?;
    let capture = Capture::load(&args.capture, &load)?;
    log.report(&capture.report);
    let report = ScheduleReport::new(&args.capture, &capture, args.steps, options)?;
    Ok(Output::new("litetex-schedule/1", json!(report), report.tables()))
}
