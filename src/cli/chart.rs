//! `litetex chart`: reads results, has charts and tables made of them, writes the files.

use super::log::Log;
use litetex_gs::chart::{Clock, Options, build};
use litetex_gs::{Error, Report, Result, atomic_file, results};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The page.
const PAGE: &str = "index.html";
/// What is written; `--force` removes these and nothing else.
const OURS: [&str; 4] = [PAGE, "tables.md", "charts", "tables"];

/// Make charts and tables of the results of "litetex bench"
///
/// Writes index.html with everything, for browsers and without network; charts/ with every chart as SVG,
/// tables/ with every table as CSV, and tables.md. Runs nothing: whatever lines are in the files is compared, each variant
/// with the baseline, paired by scene, seed and budget.
#[derive(clap::Args)]
pub struct ChartArgs {
    /// Files of results, or folders of benchmarks; of equal runs the last counts
    #[arg(required = true, value_name = "RESULTS")]
    results: Vec<PathBuf>,
    /// Folder for charts and tables
    #[arg(long, short, value_name = "FOLDER")]
    out: PathBuf,
    /// Variant that the others are compared with [default: the first]
    #[arg(long, value_name = "VARIANT")]
    baseline: Option<String>,
    /// Count the times of runs that were made on a busy machine
    #[arg(long)]
    include_noisy: bool,
    /// Which time: auto is cpu where every run was computed by the CPU, else wall
    #[arg(long, value_name = "CLOCK", default_value = "auto")]
    clock: ClockArg,
    /// Replace charts and tables in a folder that is not empty; files that are not ours stay
    #[arg(long)]
    force: bool,
}

/// Clock, as typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum ClockArg {
    /// By the devices
    Auto,
    /// CPU seconds of the process
    Cpu,
    /// Wall seconds
    Wall,
}

/// Reads, makes, writes, and prints the main table.
///
/// # Errors
/// [`Error::Io`], [`Error::InvalidInput`] for a file without a line that can be used, [`Error::Usage`].
pub fn run(args: &ChartArgs, log: &Log) -> anyhow::Result<()> {
    check_free(&args.out, args.force)?;
    let mut report = Report::default();
    let files = args.results.iter().map(|path| read(path, &mut report)).collect::<Result<Vec<_>>>()?;
    log.report(&report);
    let clock = match args.clock {
        ClockArg::Auto => Clock::Auto,
        ClockArg::Cpu => Clock::Cpu,
        ClockArg::Wall => Clock::Wall,
    };
    let options = Options { baseline: args.baseline.clone(), include_noisy: args.include_noisy, clock };
    let output = build(files, &options)?;
    log.report(&output.report);
    if args.force {
        remove_ours(&args.out)?;
    }
    for (name, text) in &output.files {
        let path = args.out.join(name);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        atomic_file::write(&path, text.as_bytes())?;
    }
    let mut out = std::io::stdout().lock();
    write!(out, "{}", output.results_markdown)?;
    log.info(&format!("{} files; look at {}", output.files.len(), args.out.join(PAGE).display()));
    Ok(out.flush()?)
}

fn read(path: &Path, report: &mut Report) -> Result<Vec<results::Record>> {
    let file = if path.is_dir() { path.join("results.jsonl") } else { path.to_owned() };
    let (records, found) = results::read(&file)?;
    if records.is_empty() {
        let why = found.warnings.first().map_or("it is empty".to_owned(), |w| w.message.clone());
        return Err(Error::invalid(
            &file,
            format!("no line of results that can be used, expected what litetex bench writes: {why}"),
        ));
    }
    report.merge(found);
    Ok(records)
}

fn check_free(folder: &Path, force: bool) -> Result<()> {
    if folder.is_file() {
        return Err(Error::Usage(format!("{}: is a file, not a folder", folder.display())));
    }
    let is_empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    if force || is_empty {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "{}: the output folder is not empty; --force replaces the charts and tables in it",
        folder.display()
    )))
}

/// Charts of other results would look like charts of these.
fn remove_ours(folder: &Path) -> Result<()> {
    for path in OURS.map(|name| folder.join(name)) {
        let removed = match std::fs::symlink_metadata(&path) {
            Ok(meta) if meta.is_dir() => std::fs::remove_dir_all(&path),
            Ok(_) => std::fs::remove_file(&path),
            Err(_) => Ok(()),
        };
        removed.map_err(|e| Error::io(&path, e))?;
    }
    Ok(())
}
