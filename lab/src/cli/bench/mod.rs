//! `litetex-lab bench`: runs a matrix of trainings in processes of their own and collects one line of results for each.
//! The matrix and the results are defined in the library.

mod args;
mod captures;
mod folder;
mod messages;
mod runner;

use super::litetex::Litetex;
pub use args::BenchArgs;
use args::Words;
use folder::{RESULTS, RUNS};
use litetex_gs::console::{Interrupt, Log, Output, path_text};
use litetex_gs::run::{Outcome, work_through};
use litetex_gs::{Error, Result, memory};
use litetex_lab::chart::summary;
use litetex_lab::matrix::{Cell, Matrix, check_captures, shard};
use litetex_lab::results::{self, Record, Status};
use litetex_lab::{machine, words};
use runner::Runner;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// Makes the unfinished runs of the matrix and prints a table of all.
///
/// # Errors
/// [`Error::CheckFailed`] if a run failed, [`Error::Interrupted`], [`Error::Usage`] for a mistake in the matrix,
/// [`Error::InvalidInput`] for a missing capture.
pub fn run(args: &BenchArgs, threads: Option<u16>, log: &Log) -> Result<Output> {
    let matrix = matrix_of(args, threads)?;
    let litetex = Litetex::find(args.binary.as_deref())?;
    let cells = matrix.cells(&litetex)?;
    let total = cells.len();
    let (part, parts) = args.shard;
    let mut cells = shard(cells, part, parts);
    captures::place(&mut cells, &args.out);
    let file = args.out.join(RESULTS);
    let (known, _lock) = folder::open(args, &file, log)?;
    let build = litetex.build();
    log.report(&messages::other_builds(&known, &build, &file));
    let left: Vec<&Cell> = cells.iter().filter(|c| !is_done(&known, c, args.retry_failed)).collect();
    check_captures(&left)?;
    if args.dry_run {
        return Ok(messages::list(&cells, &left, &known));
    }
    rename(&cells, &known, &file)?;
    if parts > 1 {
        log.info(&format!("part {part} of {parts}: {} of {total} runs", cells.len()));
    }
    if left.len() < cells.len() {
        log.info(&format!("{} of {} runs are done already", cells.len() - left.len(), cells.len()));
    }
    captures::make(&left, litetex.program(), log)?;
    let outcome = run_cells(args, &left, cells.len(), &file, &litetex, log);
    let records = folder::read_results(&file, log)?;
    let mine: Vec<&Record> = cells.iter().filter_map(|c| records.iter().find(|r| r.key == c.key)).collect();
    let failed = mine.iter().filter(|r| r.status == Status::Failed).count();
    let failure = (failed > 0).then(|| {
        Error::CheckFailed(format!(
            "{failed} of {} runs failed: see \"error\" in {} and {}; --retry-failed repeats them",
            mine.len(),
            file.display(),
            args.out.join(RUNS).join("*.log").display()
        ))
    });
    let text = match failed < mine.len() {
        true => summary(mine.iter().copied().cloned().collect(), &matrix.scenes)?,
        false => String::new(),
    };
    let found =
        json!({ "runs": cells.len(), "done": mine.len(), "failed": failed, "results": path_text(&file) });
    Ok(Output::new("litetex-bench/1", found, text).failing(outcome.err().or(failure)))
}

/// Where the worst test view of a run is, if the matrix asked for it. `out` is the folder of the benchmark.
pub fn worst_view(out: &Path, run: &Record) -> PathBuf {
    let names = [&*run.scene, &*run.variant, &*run.budget];
    out.join(RUNS).join(runner::folder_name(names, run.seed, &run.key)).join(runner::WORST_VIEW)
}

fn matrix_of(args: &BenchArgs, threads: Option<u16>) -> Result<Matrix> {
    let mut matrix = args.config.as_deref().map(Matrix::read).transpose()?.unwrap_or_default();
    if !args.scene.is_empty() {
        matrix.scenes.clone_from(&args.scene);
    }
    if !args.variant.is_empty() {
        matrix.variants.clone_from(&args.variant);
    }
    if !args.budget.is_empty() {
        matrix.budgets.clone_from(&args.budget);
    }
    if let Some(seeds) = &args.seeds {
        matrix.seeds = words::parse_seeds(seeds).map_err(|e| Error::Usage(format!("--seeds: {e}")))?;
    }
    if let Some(Words(common)) = &args.common {
        matrix.common.clone_from(common);
    }
    if let Some(threads) = threads {
        matrix.common.splice(0..0, ["--threads".to_owned(), threads.to_string()]);
    }
    Ok(matrix)
}

fn is_done(known: &[Record], cell: &Cell, retry_failed: bool) -> bool {
    known.iter().any(|r| r.key == cell.key && (r.status == Status::Ok || !retry_failed))
}

/// A finished run may have another name or position in the matrix by now; records these in a new line.
fn rename(cells: &[Cell], known: &[Record], file: &Path) -> Result<()> {
    for cell in cells {
        let Some(record) = known.iter().find(|r| r.key == cell.key) else { continue };
        if (&record.variant, &record.budget, record.cell) != (&cell.variant, &cell.budget, cell.index) {
            let (variant, budget) = (cell.variant.clone(), cell.budget.clone());
            results::append(file, &Record { variant, budget, cell: cell.index, ..record.clone() })?;
        }
    }
    Ok(())
}

/// Makes the unfinished runs, several at a time; their results are written and reported as they end.
fn run_cells(
    args: &BenchArgs,
    left: &[&Cell],
    all: usize,
    file: &Path,
    litetex: &Litetex,
    log: &Log,
) -> Result<()> {
    if left.is_empty() {
        return Ok(());
    }
    let interrupt = Interrupt::listen(log, "ending the runs in progress")?;
    let runner = runner(args, litetex, interrupt.clone());
    let (started, mut done) = (Instant::now(), 0);
    let outcome = work_through(
        left,
        runner.jobs,
        &|| interrupt.is_requested(),
        |cell| {
            Ok(match runner.run(cell)? {
                Some(record) if args.fail_fast && record.status == Status::Failed => Outcome::Last(record),
                Some(record) => Outcome::GoOn(record),
                None => Outcome::Nothing,
            })
        },
        |record: Record| {
            results::append(file, &record)?;
            done += 1;
            let secs_left = started.elapsed().as_secs_f64() / done as f64 * (left.len() - done) as f64;
            messages::finished(log, &record, all - left.len() + done, all, secs_left);
            Ok(())
        },
    );
    if matches!(outcome, Err(Error::Interrupted)) {
        log.info(&format!("results so far are in {}; the same command continues", file.display()));
    }
    outcome
}

fn runner(args: &BenchArgs, litetex: &Litetex, interrupt: Interrupt) -> Runner {
    Runner {
        program: litetex.program().to_owned(),
        runs: args.out.join(RUNS),
        keep_runs: args.keep_runs,
        export: !args.no_export,
        jobs: usize::from(args.jobs),
        timeout_secs: args.timeout,
        interrupt,
        hardware: machine::hardware(memory::machine_bytes()),
        build: litetex.build(),
        own_load: Mutex::new(Vec::new()),
    }
}
