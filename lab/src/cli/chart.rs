//! `litetex-lab chart`: reads results, has charts and tables made of them, and writes the files.

use super::bench;
use base64::prelude::{BASE64_STANDARD, Engine as _};
use litetex_gs::console::{self, Log, path_text};
use litetex_gs::{Error, Report, Result, atomic_file, input_file};
use litetex_lab::chart::{Clock, MANIFEST, Options, Output, PAGE, WorstView, build, manifest_entries};
use litetex_lab::matrix::{Matrix, SceneEntry};
use litetex_lab::results;
use serde_json::json;
use std::collections::HashSet;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Largest list of files that is read.
const MANIFEST_BYTES_MAX: u64 = 1 << 24;
/// Largest image that is put into the page.
const IMAGE_BYTES_MAX: u64 = 1 << 22;

/// Make charts and tables of the results of "litetex-lab bench"
///
/// Writes index.html, a self-contained page with everything; charts/ with every chart as SVG; tables/ with every table
/// as CSV; and tables.md. Compares the runs in the files, each variant with the baseline, paired by scene, seed and
/// budget. Trains nothing.
#[derive(clap::Args)]
pub struct ChartArgs {
    /// Result files or benchmark folders; of repeated runs the last one counts
    #[arg(required = true, value_name = "RESULTS")]
    results: Vec<PathBuf>,
    /// Folder for charts and tables
    #[arg(long, short, value_name = "FOLDER")]
    out: PathBuf,
    /// Variant that the others are compared with [default: the first]
    #[arg(long, value_name = "VARIANT")]
    baseline: Option<String>,
    /// Include times measured on a busy machine
    #[arg(long)]
    include_noisy: bool,
    /// Draw a heat map of the checks in the scenes of this matrix, the TOML file of the benchmark: what passes, with the
    /// figures, and the worst test views that the runs have kept
    #[arg(long, value_name = "FILE")]
    checks: Option<PathBuf>,
    /// Clock that times are taken from; auto: cpu if every run used the CPU as its device, else wall
    #[arg(long, value_name = "CLOCK", default_value = "auto", value_parser = ["auto", "cpu", "wall"])]
    clock: String,
    /// Replace the files that an earlier "litetex-lab chart" wrote into the folder; other files stay
    #[arg(long)]
    force: bool,
}

/// Reads results, writes the files and reports the main table.
///
/// # Errors
/// [`Error::Io`], [`Error::InvalidInput`] for a file without usable results, [`Error::Usage`] for a folder with other
/// contents.
pub fn run(args: &ChartArgs, log: &Log) -> Result<console::Output> {
    let earlier = earlier_files(&args.out, args.force)?;
    let mut report = Report::default();
    let files = args.results.iter().map(|path| read(path, &mut report)).collect::<Result<Vec<_>>>()?;
    log.report(&report);
    let clock = match &*args.clock {
        "cpu" => Clock::Cpu,
        "wall" => Clock::Wall,
        _ => Clock::Auto,
    };
    let cases = args.checks.as_deref().map(cases).transpose()?.unwrap_or_default();
    let worst_views = if cases.is_empty() { Vec::new() } else { worst_views(&args.results, &files)? };
    let options = Options {
        baseline: args.baseline.clone(),
        include_noisy: args.include_noisy,
        clock,
        cases,
        worst_views,
    };
    let output = build(files, &options)?;
    replace(&args.out, &earlier, &output)?;
    log.report(&output.report);
    log.info(&format!("{} files; open {}", output.files.len(), args.out.join(PAGE).display()));
    let files: Vec<&String> = output.files.iter().map(|(name, _)| name).collect();
    let found = json!({ "out": path_text(&args.out), "files": files });
    Ok(console::Output::new("litetex-chart/1", found, &output.summary))
}

/// The scenes of a matrix, with their checks.
fn cases(path: &Path) -> Result<Vec<SceneEntry>> {
    let matrix = Matrix::read(path)?;
    matrix.check_checks()?;
    Ok(matrix.scenes)
}

/// The worst test view that the first run of each scene and variant has kept, in the folders of benchmarks.
fn worst_views(paths: &[PathBuf], files: &[Vec<results::Record>]) -> Result<Vec<WorstView>> {
    let mut out: Vec<WorstView> = Vec::new();
    for (folder, records) in paths.iter().zip(files).filter(|(path, _)| path.is_dir()) {
        for run in records {
            let is_known = |v: &WorstView| v.scene == run.scene && v.variant == run.variant;
            let path = bench::worst_view(folder, run);
            if out.iter().any(is_known) || !path.is_file() {
                continue;
            }
            let image = BASE64_STANDARD.encode(input_file::read(&path, IMAGE_BYTES_MAX)?);
            let uri = format!("data:image/jpeg;base64,{image}");
            out.push(WorstView { scene: run.scene.clone(), variant: run.variant.clone(), uri });
        }
    }
    Ok(out)
}

fn read(path: &Path, report: &mut Report) -> Result<Vec<results::Record>> {
    let file = if path.is_dir() { path.join("results.jsonl") } else { path.to_owned() };
    let (records, found) = results::read(&file)?;
    if records.is_empty() {
        let why = found.warnings.first().map_or("it is empty".to_owned(), |w| w.message.clone());
        return Err(Error::invalid(
            &file,
            format!("no usable results, expected a file written by litetex-lab bench: {why}"),
        ));
    }
    report.merge(found);
    Ok(records)
}

/// The files that an earlier `chart` wrote into the folder; refuses a folder with other contents, and without `force`
/// any that is not empty.
fn earlier_files(folder: &Path, force: bool) -> Result<Vec<String>> {
    let mut entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(_) if folder.is_file() => {
            return Err(Error::Usage(format!("{}: is a file, not a folder", folder.display())));
        }
        Err(e) => return Err(Error::io(folder, e)),
    };
    if entries.next().is_none() {
        return Ok(Vec::new());
    }
    if !force {
        return Err(Error::Usage(format!(
            "{}: the output folder is not empty; --force replaces the charts and tables in it",
            folder.display()
        )));
    }
    let manifest = folder.join(MANIFEST);
    match input_file::read_text(&manifest, MANIFEST_BYTES_MAX) {
        Ok(text) => Ok(manifest_entries(&text)),
        Err(Error::Io { cause, .. }) if cause.kind() == ErrorKind::NotFound => Err(Error::Usage(format!(
            "{}: the folder is not empty and contains no {MANIFEST}, so litetex-lab chart did not write it; choose \
             another folder",
            folder.display()
        ))),
        Err(e) => Err(e),
    }
}

/// Replaces earlier charts and tables: of other results, they would look like charts of these.
fn replace(folder: &Path, earlier: &[String], output: &Output) -> Result<()> {
    let ours: HashSet<&str> = earlier.iter().map(String::as_str).collect();
    if let Some((name, _)) =
        output.files.iter().find(|(name, _)| !ours.contains(&**name) && folder.join(name).exists())
    {
        return Err(Error::Usage(format!(
            "{}: litetex-lab chart did not write this file and will not replace it; move it away, or choose another \
             folder",
            folder.join(name).display()
        )));
    }
    let mut names = earlier.iter().chain(output.files.iter().map(|(name, _)| name));
    names.try_for_each(|name| atomic_file::check_place(&folder.join(name)))?;
    // The manifest stays until it is replaced, in case this is interrupted.
    for name in earlier.iter().filter(|name| *name != MANIFEST) {
        let path = folder.join(name);
        match fs::remove_file(&path) {
            Err(e) if e.kind() != ErrorKind::NotFound => return Err(Error::io(&path, e)),
            _ => {}
        }
    }
    for (name, text) in &output.files {
        let path = folder.join(name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        atomic_file::write(&path, text.as_bytes())?;
    }
    Ok(())
}
