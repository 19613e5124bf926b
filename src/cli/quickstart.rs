//! `litetex quickstart`: sample, train, evaluate, pictures; two minutes from nothing to a result.

use super::log::Log;
use super::run_folder::RunFolder;
use super::train;
use super::train_args::{TrainArgs, TrainingArgs};
use litetex_gs::sample::{SampleOptions, write_sample};
use std::io::Write;
use std::path::PathBuf;

/// Steps of the schedule: about a minute on two cores at the sample's size (measured: 38 steps a second).
const STEPS: u32 = 2_000;
/// Training time after which it ends early on slow machines.
const MAX_TIME_SECS: f64 = 60.0;

/// Try everything: make a sample capture, train it for about a minute, evaluate
#[derive(clap::Args)]
pub struct QuickstartArgs {
    /// Folder for the capture and the run
    #[arg(long, short, value_name = "DIR", default_value = "litetex-quickstart")]
    out: PathBuf,
    /// Replace an earlier quickstart
    #[arg(long)]
    force: bool,
    /// Steps
    #[arg(long, value_name = "N", default_value_t = STEPS, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
}

/// Makes, trains, evaluates, and says what to try next.
pub fn run(args: &QuickstartArgs, log: &Log) -> anyhow::Result<()> {
    let capture = args.out.join("still-life");
    let run = args.out.join("run");
    RunFolder::check_free(&args.out, args.force)?;
    log.info(&format!("1/2 making a sample capture in {}", capture.display()));
    if capture.exists() {
        // Reached with --force only; the capture is ours.
        std::fs::remove_dir_all(&capture)?;
    }
    write_sample(&capture, &SampleOptions::default())?;
    log.info(&format!("2/2 training {} steps, at most {MAX_TIME_SECS:.0} s, on the CPU", args.steps));
    let train_args = TrainArgs {
        capture: Some(capture.clone()),
        out: Some(run.clone()),
        force: args.force,
        device: "cpu".to_owned(),
        training: TrainingArgs {
            steps: Some(args.steps),
            max_time: Some(MAX_TIME_SECS),
            eval_every: Some((args.steps / 3).max(1)),
            ..TrainingArgs::default()
        },
        ..TrainArgs::default()
    };
    let summary = train::train_run(&train_args, log)?;
    train::print(&summary)?;
    let (capture, run) = (capture.display(), run.display());
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "\nLook at  {run}/eval/{:06}/ (pictures; error/ holds error maps) beside {capture}/images/\n\
         Then try\n  \
         litetex render {run} --orbit 60 -o {run}/orbit\n  \
         litetex render {run} --test --what colour,depth,normal -o {run}/views\n  \
         litetex inspect {run}\n  \
         litetex train {capture} -o runs/untextured --policy plain --steps {}\n  \
         litetex train <your COLMAP or nerfstudio folder> -o runs/mine --max-resolution 480 --steps 1000",
        summary.steps, summary.steps_planned
    )?;
    Ok(())
}
