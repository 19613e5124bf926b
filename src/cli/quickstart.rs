//! `litetex quickstart`: from nothing to a trained and exported scene in two minutes.

use super::asset_args::AssetArgs;
use super::export_files;
use super::sources::load_scene;
use super::train;
use super::train_args::{TrainArgs, TrainingArgs};
use super::train_summary;
use litetex_gs::console::values::whole;
use litetex_gs::console::{Log, Output};
use litetex_gs::run::{check_empty, is_run};
use litetex_gs::sample::{SampleOptions, write_sample};
use litetex_gs::text::{counted, shell_word};
use litetex_gs::{Error, Result, usage};
use std::path::{Path, PathBuf};

/// Name of the sample, its folder and its assets.
const NAME: &str = "still-life";
/// Name of the run's folder.
const RUN: &str = "run";
/// Formats of the exported assets.
const EXPORTS: [&str; 4] = ["glb", "ltgs", "usdz", "ply"];
/// Steps of the training: about a minute on two cores at the sample's size (measured: 38 steps per second).
const STEPS: u32 = 2_000;

/// Try everything: make a sample capture, train for a minute, evaluate, export
#[derive(clap::Args)]
pub struct QuickstartArgs {
    /// Folder for the capture and the run
    #[arg(long, short, value_name = "DIR", default_value = "litetex-quickstart")]
    out: PathBuf,
    /// Replace an earlier quickstart
    #[arg(long)]
    force: bool,
    /// Steps of the training
    #[arg(long, value_name = "N", default_value_t = STEPS, value_parser = whole::<u32>(1..=u64::MAX))]
    steps: u32,
}

/// Makes the sample, trains, exports, and says what to try next.
pub fn run(args: &QuickstartArgs, log: &Log) -> Result<Output> {
    let capture = args.out.join(NAME);
    let run = args.out.join(RUN);
    check_folder(&args.out, args.force)?;
    log.info(&format!("1/3 making a sample capture in {}", capture.display()));
    // An earlier sample has the same files.
    write_sample(&capture, &SampleOptions::default())?;
    log.info(&format!("2/3 training {} on the CPU", counted(args.steps as usize, "step")));
    let train_args = TrainArgs {
        captures: vec![capture.clone()],
        out: Some(run.clone()),
        force: args.force,
        device: "cpu".to_owned(),
        training: TrainingArgs {
            steps: Some(args.steps),
            settings: vec![format!("eval-every={}", (args.steps / 3).max(1))],
            ..TrainingArgs::default()
        },
        ..TrainArgs::default()
    };
    let summary = train::train_run(&train_args, log)?.summary;
    log.info("3/3 writing assets, and rendering each to verify it");
    let asset = AssetArgs { force: args.force, title: Some("Still life".to_owned()), ..AssetArgs::default() };
    let files = EXPORTS.map(|extension| args.out.join(format!("{NAME}.{extension}")));
    let (scene, trained) = load_scene(&run, log)?;
    let exports = export_files::write_all((scene, trained.as_ref()), &files, &asset, "cpu", log)?.output();
    let word = |path: &str| shell_word(&args.out.join(path));
    let shown = |path: &Path| path.display().to_string();
    let (of_run, of_capture) = (shown(&run), shown(&capture));
    let (orbit, views, asset) =
        (word(&format!("{RUN}/orbit")), word(&format!("{RUN}/views")), word(&format!("{NAME}.ltgs")));
    let (run, capture) = (shell_word(&run), shell_word(&capture));
    let next = Output::text(format!(
        "Compare  {of_run}/eval/{:06}/ (images; error/ holds error maps) with {of_capture}/images/\n\
         Then try\n  \
         litetex render {run} --orbit 60 -o {orbit}\n  \
         litetex render {run} --test --what colour,depth,normal -o {views}\n  \
         litetex inspect {run}\n  \
         litetex verify {asset} --against {run}\n  \
         litetex train {capture} -o runs/untextured --for engine --steps {}\n  \
         litetex train <your COLMAP or nerfstudio folder> -o runs/mine --time 10m\n  \
         litetex view {run}\n",
        summary.steps, summary.steps_planned
    ));
    Ok(train_summary::output(&summary).with("exports", exports).with("next", next))
}

/// Refuses a folder that is not empty; with `force`, accepts one that holds only a quickstart, with its run.
fn check_folder(folder: &Path, force: bool) -> Result<()> {
    if !force || !folder.is_dir() {
        return check_empty(folder);
    }
    let mut is_empty = true;
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let name = entry.map_err(|e| Error::io(folder, e))?.file_name();
        if Path::new(&name).file_stem().is_none_or(|stem| stem != NAME && stem != RUN) {
            return Err(usage!(
                "{}: the folder is not empty, and quickstart did not write {name:?}, so --force does not replace it; choose \
                 another folder",
                folder.display()
            ));
        }
        is_empty = false;
    }
    // Files of these names alone may be anyone's.
    let run = folder.join(RUN);
    if is_empty || is_run(&run) {
        return Ok(());
    }
    Err(usage!(
        "{}: the folder is not empty, and {} is no run, so it holds no whole quickstart and --force does not replace it; \
         empty the folder, or choose another",
        folder.display(),
        run.display()
    ))
}
