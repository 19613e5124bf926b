//! `litetex train A B C -o RUNS`: one process after the other trains a capture each, so that memory is free before the next one
//! and a crash ends one run alone; a table grows with them.

use super::asset_args::AssetArgs;
use super::outputs;
use super::train_args::TrainArgs;
use super::train_job::check_settings;
use litetex_gs::console::{Interrupt, Log, Output, columns};
use litetex_gs::run::{
    BatchRun, BatchTable, End, Outcome, Process, Row, RowStatus, RunFolder, RunState, Stop, Summary,
    batch_runs, is_run, share, table_to_json, work_through,
};
use litetex_gs::text::{counted, format_duration};
use litetex_gs::{Error, Result, usage};
use std::collections::HashMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Hidden option of `litetex`, before the command: which capture of the list a process trains.
const NTH: &str = "--nth";

/// Whether the arguments ask for a folder of runs: for several captures, or a part of them, which may be one.
pub fn is_batch(args: &TrainArgs) -> bool {
    args.captures.len() > 1 || args.shard.is_some()
}

/// Refuses the arguments of a batch where those of one run are meant.
///
/// # Errors
/// [`Error::Usage`] with what makes them a batch.
pub fn check_single(args: &TrainArgs) -> Result<()> {
    match (args.captures.get(1), &args.shard) {
        (Some(another), _) => Err(usage!("{}: a second capture, where one run is meant", another.display())),
        (None, Some(_)) => Err(usage!("--shard: makes a folder of runs, where one run is meant")),
        (None, None) => Ok(()),
    }
}

/// Reduces the arguments of a batch to those of one of its runs.
///
/// # Errors
/// [`Error::Usage`] if there is no such run.
pub fn narrow(args: &mut TrainArgs, index: usize) -> Result<()> {
    let run =
        runs_of(args)?.into_iter().nth(index).ok_or_else(|| usage!("{NTH} {index}: no such capture"))?;
    (args.captures, args.out, args.shard) = (vec![run.capture], Some(run.folder), None);
    Ok(())
}

/// The files of `--export`, with the name and the path of the run put in.
///
/// # Errors
/// [`Error::Usage`] if there is no run to name them after.
pub fn exports_of(args: &TrainArgs) -> Result<Vec<PathBuf>> {
    let is_pattern = |file: &&PathBuf| ["{name}", "{run}"].iter().any(|p| file.to_string_lossy().contains(p));
    let Some(out) = &args.out else {
        return match args.export.iter().find(is_pattern) {
            Some(file) => Err(usage!("--export {}: name the folder of the run with --out", file.display())),
            None => Ok(args.export.clone()),
        };
    };
    let absolute = std::path::absolute(out).map_err(|e| Error::io(out, e))?;
    let name = absolute.file_name().unwrap_or_default().to_string_lossy();
    let placed = |file: &PathBuf| match is_pattern(&file) {
        true => {
            file.to_string_lossy().replace("{name}", &name).replace("{run}", &out.to_string_lossy()).into()
        }
        // Names that are not Unicode stay as they are.
        false => file.clone(),
    };
    Ok(args.export.iter().map(placed).collect())
}

/// Trains the captures of this part and prints their table.
///
/// # Errors
/// [`Error::CheckFailed`] if a run failed, [`Error::Interrupted`], [`Error::Usage`] for arguments that cannot be meant so.
pub fn run(args: &TrainArgs, log: &Log) -> Result<Output> {
    let all = runs_of(args)?;
    warn_of_repeated(&all, log);
    let (part, parts) = args.shard.unwrap_or((1, 1));
    let count = all.len();
    let runs = share(all, part, parts);
    check(args, &runs)?;
    let out = args.out.as_deref().unwrap_or(Path::new("."));
    let table = BatchTable::open(out)?;
    table.expect(&runs)?;
    let interrupt = Interrupt::listen(log, "saving the run in progress; no other begins")?;
    if parts > 1 {
        log.info(&format!("part {part} of {parts}: {} of {}", runs.len(), counted(count, "capture")));
    }
    let program = std::env::current_exe().map_err(|e| Error::io("litetex", e))?;
    let batch = Batch { program, table, interrupt: interrupt.clone(), count: runs.len(), log };
    let numbered: Vec<(usize, &BatchRun)> = (1..).zip(&runs).collect();
    let (started, mut done) = (Instant::now(), 0);
    let outcome = work_through(
        &numbered,
        1,
        &|| interrupt.is_requested(),
        |&(number, run)| batch.train(number, run),
        |(number, row): (usize, Row)| {
            batch.table.record(&row)?;
            done += 1;
            let secs_left = started.elapsed().as_secs_f64() / f64::from(done) * (runs.len() - number) as f64;
            batch.say(number, &row, secs_left);
            Ok(())
        },
    );
    batch.report(&runs, outcome)
}

/// What the runs of a batch share.
struct Batch<'a> {
    program: PathBuf,
    table: BatchTable,
    interrupt: Interrupt,
    count: usize,
    log: &'a Log,
}

impl Batch<'_> {
    /// Trains one capture in a process of its own, with the arguments of this one.
    fn train(&self, number: usize, run: &BatchRun) -> Result<Outcome<(usize, Row)>> {
        let (name, capture, folder) = (&run.name, run.capture.display(), run.folder.display());
        self.log.info(&format!("[{number}/{}] {name}: training {capture} into {folder}", self.count));
        if !matches!(RunState::of(&run.folder), Ok(RunState::Finished { .. })) {
            self.table.record(&Row::started(run))?;
        }
        let mut args: Vec<OsString> = vec![NTH.into(), run.index.to_string().into()];
        args.extend(std::env::args_os().skip(1));
        let process = Process {
            program: &self.program,
            args,
            timeout_secs: None,
            is_stopped: &|| self.interrupt.is_requested(),
            stop: Stop::EndOfInput,
            on_line: &mut |line| self.log.relay(name, line),
        };
        Ok(match process.run().map_err(|e| Error::io(&self.program, e))? {
            End::Exit(Some(0), _) => {
                let summary = Summary::read(&run.folder.join("summary.json"));
                let row = summary.map(|summary| Row::done(run, &summary));
                Outcome::GoOn((number, row.unwrap_or_else(|e| Row::failed(run, Some(0), e.to_string()))))
            }
            End::Exit(code, message) => Outcome::GoOn((number, Row::failed(run, code, message))),
            End::Interrupted | End::TimedOut => Outcome::Last((number, Row::interrupted(run))),
        })
    }

    /// Reports a run that has ended.
    fn say(&self, number: usize, row: &Row, secs_left: f64) {
        let what = match (row.status, row.exit_code) {
            (RowStatus::Failed, Some(code)) => format!("FAILED with exit code {code}: {}", row.note()),
            (RowStatus::Failed, None) => format!("FAILED: {}", row.note()),
            (RowStatus::Done, _) => {
                let [psnr, gradients, splats, parameters, time] = row.figures();
                format!(
                    "{psnr} dB, gradients {gradients} dB; {splats} splats, {parameters} parameters; {time}"
                )
            }
            (status, _) => status.name().to_owned(),
        };
        let is_last = number == self.count || row.status == RowStatus::Interrupted;
        let left =
            if is_last { String::new() } else { format!("; about {} left", format_duration(secs_left)) };
        let mut fields = serde_json::json!(row);
        (fields["number"], fields["count"]) = (number.into(), self.count.into());
        self.log.event("run", &format!("[{number}/{}] {}: {what}{left}", self.count, row.run), fields);
    }

    /// The table of these runs, and the error that the command ends with.
    fn report(&self, runs: &[BatchRun], outcome: Result<()>) -> Result<Output> {
        let mut rows = self.table.rows()?;
        rows.retain(|row| runs.iter().any(|run| run.name == row.run));
        let file = self.table.markdown();
        let failed: Vec<&str> =
            rows.iter().filter(|r| r.status == RowStatus::Failed).map(|r| &*r.run).collect();
        let failure = (!failed.is_empty()).then(|| {
            Error::CheckFailed(format!(
                "{} of {} failed: {}; {} says why; --resume-or-start tries again",
                failed.len(),
                counted(runs.len(), "run"),
                failed.join(", "),
                file.display()
            ))
        });
        if matches!(outcome, Err(Error::Interrupted)) {
            let file = file.display();
            self.log.info(&format!("the table so far is in {file}; --resume-or-start continues"));
        }
        let cells = |row: &Row| {
            let ends = [row.run.clone(), row.status.name().to_owned()];
            ends.into_iter().chain(row.figures()).chain([row.note()]).collect()
        };
        let text = columns(&BatchTable::HEAD, &rows.iter().map(cells).collect::<Vec<_>>());
        let table = table_to_json(&rows);
        let schema = table["schema"].as_str().unwrap_or_default().to_owned();
        Ok(Output::new(&schema, table, text).failing(outcome.err().or(failure)))
    }
}

fn runs_of(args: &TrainArgs) -> Result<Vec<BatchRun>> {
    let Some(out) = &args.out else {
        return Err(usage!("no output folder given: litetex train <CAPTURE>... -o <FOLDER OF RUNS>"));
    };
    if args.captures.is_empty() {
        return Err(usage!("no capture given: litetex train <CAPTURE>... -o <FOLDER OF RUNS> --shard 1/3"));
    }
    Ok(batch_runs(&args.captures, out))
}

/// Refuses before the first training what would fail for each.
fn check(args: &TrainArgs, runs: &[BatchRun]) -> Result<()> {
    let out = args.out.as_deref().unwrap_or(Path::new("."));
    if args.resume.is_some() {
        return Err(usage!("--resume continues one run; several captures: --resume-or-start"));
    }
    if args.view.is_some() {
        return Err(usage!(
            "--view shows one run; several captures: litetex view <RUN> follows the one that trains"
        ));
    }
    if is_run(out) {
        return Err(usage!(
            "{}: the folder holds a run; several captures need a folder of runs, choose another",
            out.display()
        ));
    }
    let is_shared = |file: &&PathBuf| !["{name}", "{run}"].iter().any(|p| file.to_string_lossy().contains(p));
    if let Some(file) = args.export.iter().find(is_shared) {
        let file = file.display();
        return Err(usage!(
            "--export {file}: each run would replace this file; name it after the run: --export 'pages/{{name}}.html', or \
             '{{run}}/scene.glb' in its folder"
        ));
    }
    for run in runs {
        let mut of_run = args.clone();
        narrow(&mut of_run, run.index)?;
        check_settings(&of_run)?;
        if !args.resume_or_start {
            RunFolder::check_free(&run.folder, args.force)?;
        }
        let asset = AssetArgs { force: args.force || args.resume_or_start, ..AssetArgs::default() };
        outputs::check(None, &exports_of(&of_run)?, &asset)?;
    }
    Ok(())
}

fn warn_of_repeated(runs: &[BatchRun], log: &Log) {
    let mut known = HashMap::new();
    for run in runs {
        let Ok(path) = run.capture.canonicalize() else { continue };
        if let Some(first) = known.insert(path, &run.name) {
            let what = format!(
                "{}: given twice; {} will be the same as {first}, which takes its time",
                run.capture.display(),
                run.name
            );
            log.warn("capture-given-twice", &what, 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exports_are_named_after_their_run() {
        let args = TrainArgs {
            out: Some("runs/fox-2".into()),
            export: ["a.glb", "pages/{name}.html", "{run}/{name}.ltgs"].map(PathBuf::from).into(),
            ..TrainArgs::default()
        };
        let names: Vec<String> = exports_of(&args).unwrap().iter().map(|p| p.display().to_string()).collect();
        assert_eq!(names, ["a.glb", "pages/fox-2.html", "runs/fox-2/fox-2.ltgs"]);
        let error = exports_of(&TrainArgs { out: None, ..args }).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("--out"), "{error}");
    }
}
