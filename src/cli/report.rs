//! `litetex report`: a run as one web page.

use super::asset_args::{AssetArgs, QualityName};
use super::export_files::write_all;
use super::report_figures::{facts, figures_of_files, metadata, open_capture};
use super::report_views::{measure_coverage, worst_views};
use super::sources::{load_scene, on_device, read_limits};
use litetex_exporters::{Format, read_asset};
use litetex_gs::console::{Interrupt, Log, Output, Table, check_free, path_text};
use litetex_gs::report_page::{ReportFigures, TrainingCurve, report_html};
use litetex_gs::run::{StagedFolder, Trained, run_of_checkpoint};
use litetex_gs::text::format_bytes;
use litetex_gs::{Error, Result, atomic_file, input_file, usage};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Largest `metrics.jsonl` that is read: a thousand bytes for each tenth step.
const METRICS_BYTES_MAX: u64 = 1 << 28;

/// Write a run as one web page: the scene, its worst views, and what was measured
///
/// Beneath the scene, which can be turned as in an exported .html file, stand the three worst test views beside their photos, how many
/// training views show what, the curve of the training, the sizes and losses of files, the verdict on the capture, settings and
/// rights. The page needs no network, and other commands read the scene in it as they read any exported .html file.
#[derive(clap::Args)]
pub struct ReportArgs {
    /// Folder of a run, or a checkpoint
    #[arg(value_name = "RUN|CHECKPOINT")]
    source: PathBuf,
    /// Files exported from the run, to be listed with their sizes and losses
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Page to write, a .html file
    #[arg(long, short, value_name = "FILE", required = true)]
    out: PathBuf,
    /// Capture of the run, if it has been moved
    #[arg(long, value_name = "DIR")]
    capture: Option<PathBuf>,
    /// How closely the scene in the page reproduces the trained one [default: balanced]
    #[arg(long, value_name = "QUALITY")]
    quality: Option<QualityName>,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    /// Title of the work [default: name of the capture]
    #[arg(long, value_name = "TEXT", help_heading = "Provenance")]
    title: Option<String>,
    /// Author of the work
    #[arg(long, value_name = "TEXT", help_heading = "Provenance")]
    author: Option<String>,
    /// Licence of the data, such as CC-BY-4.0
    #[arg(long, value_name = "TEXT", visible_alias = "license", help_heading = "Provenance")]
    licence: Option<String>,
    /// Source of the work [default: name of the capture]
    #[arg(long = "source", value_name = "TEXT", help_heading = "Provenance")]
    made_from: Option<String>,
    /// Where to render
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Measures, writes, prints.
pub fn run(args: &ReportArgs, log: &Log) -> Result<Output> {
    let interrupt = Interrupt::listen(log, "removing unfinished files")?;
    check(args)?;
    let (scene, trained) = load_scene(&args.source, log)?;
    let Some(trained) = trained else {
        return Err(usage!("{}: is an asset, expected a run or a checkpoint", args.source.display()));
    };
    let (capture, no_photos) = open_capture(&trained, args.capture.as_deref(), log)?;
    let others = figures_of_files(&args.files, &scene, capture.as_ref(), &args.device, log)?;

    let mut figures = ReportFigures { no_photos, ..ReportFigures::default() };
    if let Some(capture) = &capture {
        let mut backend = on_device(&trained, &args.device, log)?;
        figures.views = worst_views(&trained, backend.as_mut(), capture, &interrupt)?;
        figures.coverage = measure_coverage(&trained, backend.as_mut(), capture, &interrupt)?;
        figures.verdict = Some(capture.verdict());
    }
    figures.curve = curve_of(&trained, log);
    figures.facts = facts(&trained, capture.as_ref());

    let folder = args.out.parent().filter(|f| !f.as_os_str().is_empty());
    if let Some(folder) = folder {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    let staging = StagedFolder::new(args.out.with_extension("scene"))?;
    let file = staging.path().join("scene.ltgs");
    let exports = write_all(
        (scene, Some(&trained)),
        std::slice::from_ref(&file),
        &args.asset_args(),
        &args.device,
        log,
    )?;
    figures.files = exports.figures()?;
    if let Some(first) = figures.files.first_mut() {
        "the scene in this page".clone_into(&mut first.name);
    }
    figures.files.extend(others);
    let provenance = read_asset(&file, &read_limits())?.asset.provenance;
    figures.metadata = metadata(&provenance);
    let ltgs = std::fs::read(&file).map_err(|e| Error::io(&file, e))?;
    drop(staging);

    let html = report_html(&figures, &ltgs, &provenance)?;
    interrupt.check()?;
    atomic_file::write(&args.out, &html)?;
    Ok(output(&args.out, html.len() as u64, ltgs.len() as u64, &figures))
}

/// Refuses what cannot be written, before anything is measured.
fn check(args: &ReportArgs) -> Result<()> {
    let out = &args.out;
    if Format::from_path(out) != Some(Format::Html) {
        return Err(usage!("{}: expected a file whose name ends in .html", out.display()));
    }
    check_free(std::slice::from_ref(out), args.force)
}

impl ReportArgs {
    /// How the scene in the page is exported.
    fn asset_args(&self) -> AssetArgs {
        AssetArgs {
            quality: self.quality,
            title: self.title.clone(),
            author: self.author.clone(),
            licence: self.licence.clone(),
            made_from: self.made_from.clone(),
            ..AssetArgs::default()
        }
    }
}

/// The curve in the folder of the run; empty, with a warning, if it cannot be read.
fn curve_of(trained: &Trained, log: &Log) -> TrainingCurve {
    let Some(path) = run_of_checkpoint(&trained.path).map(|run| run.join("metrics.jsonl")) else {
        return TrainingCurve::default();
    };
    match input_file::read_text(&path, METRICS_BYTES_MAX) {
        Ok(text) => TrainingCurve::from_metrics(&text),
        Err(error) => {
            log.warn("no-curve", &format!("the report has no curve of the training: {error}"), 1);
            TrainingCurve::default()
        }
    }
}

fn output(path: &Path, bytes: u64, scene_bytes: u64, figures: &ReportFigures) -> Output {
    let views = figures.views.as_ref().map(|worst| {
        let each =
            worst.views.iter().map(|v| json!({ "name": v.name, "psnr": v.psnr, "grad_psnr": v.grad_psnr }));
        json!({ "are_training": worst.are_training, "views": each.collect::<Vec<_>>() })
    });
    let found = json!({
        "file": path_text(path),
        "bytes": bytes,
        "scene_bytes": scene_bytes,
        "worst_views": views,
        "coverage": figures.coverage,
        "files": figures.files,
        "verdict": figures.verdict,
        "no_photos": figures.no_photos,
    });
    let mut table = Table::default();
    table.row("file", path.display());
    table.row("size", format!("{}, of which the scene {}", format_bytes(bytes), format_bytes(scene_bytes)));
    if let Some(worst) = &figures.views {
        let kind = if worst.are_training { "worst training views" } else { "worst test views" };
        let each = worst.views.iter().map(|v| format!("{} {:.2} dB", v.name, v.psnr));
        table.row(kind, each.collect::<Vec<_>>().join(", "));
    }
    if let Some(verdict) = &figures.verdict {
        table.row("verdict on the capture", verdict.rating.words());
    }
    if let Some(why) = &figures.no_photos {
        table.row("photos", format!("none: {why}"));
    }
    Output::new("litetex-report/1", found, table)
}
