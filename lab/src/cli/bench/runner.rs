//! Makes one run of a benchmark in a process of its own, so that memory, CPU time and crashes do not affect other runs,
//! and turns its outcome into a line of results.

use super::folder::{plain, remove_folder};
use crate::cli::litetex::output;
use litetex_gs::console::Interrupt;
use litetex_gs::run::{End, Process, Stop};
use litetex_gs::{Error, Result, atomic_file, input_file};
use litetex_lab::machine::{self, Conditions, OwnLoad};
use litetex_lab::matrix::{Cell, with_folders};
use litetex_lab::results::{Hardware, Record, SCHEMA, Status};
use serde_json::Value;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Hidden option of `litetex train`: stop at once when standard input ends. Trainings end with the benchmark that started them,
/// even if it is killed: their results would be lost, and a restarted benchmark would repeat them while they still run.
const END_WITH_STDIN: &str = "--end-with-stdin";
/// Largest summary that is read.
const SUMMARY_BYTES_MAX: u64 = 1 << 30;
const SUMMARY: &str = "summary.json";
/// The file that shows how small a run is as an asset.
const EXPORTED: &str = "tiny.ltgs";
/// Files that stay in a run's folder without `--keep-runs`.
const KEPT: [&str; 3] = [SUMMARY, "config.toml", WORST_VIEW];
/// Where a matrix puts the worst test view, if it does.
pub const WORST_VIEW: &str = "worst.jpg";

/// What all runs share.
pub struct Runner {
    /// The program `litetex`.
    pub program: PathBuf,
    /// Parent of the runs' folders.
    pub runs: PathBuf,
    /// Whether to keep checkpoints, images and metrics.
    pub keep_runs: bool,
    /// Whether to export each run, for the size of the file.
    pub export: bool,
    /// Number of runs at the same time.
    pub jobs: usize,
    /// Time after which a run is stopped and counts as failed.
    pub timeout_secs: Option<f64>,
    pub interrupt: Interrupt,
    pub hardware: Hardware,
    /// Build of the program.
    pub build: String,
    /// Load that finished runs put on the machine.
    pub own_load: Mutex<Vec<OwnLoad>>,
}

/// The start of a run.
struct Start {
    at: Instant,
    utc: String,
    load1: Option<f64>,
    own_load1: f64,
}

/// Exit code, and the summary or the reason for its absence.
type Outcome = (Option<i32>, Result<Value, String>);

impl Runner {
    /// Makes a run; `None` if the user interrupted it.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder or the process cannot be created, since no other run could be made either. What
    /// goes wrong inside a run becomes a failed record.
    pub fn run(&self, cell: &Cell) -> Result<Option<Record>> {
        let folder =
            self.runs.join(folder_name([&cell.scene, &cell.variant, &cell.budget], cell.seed, &cell.key));
        let messages = folder.with_extension("log");
        remove_folder(&folder)?;
        fs::create_dir_all(&self.runs).map_err(|e| Error::io(&self.runs, e))?;
        let start = self.start();
        let end = self.train(cell, &folder, &messages)?;
        let wall_secs = start.at.elapsed().as_secs_f64();
        let outcome = match end {
            End::Interrupted => {
                remove_folder(&folder)?;
                let _ = fs::remove_file(&messages);
                return Ok(None);
            }
            End::TimedOut => (None, Err(format!("stopped after {wall_secs:.0} s: --timeout"))),
            End::Exit(Some(0), _) => (Some(0), self.measured(cell, &folder)),
            End::Exit(code, message) => (code, Err(message)),
        };
        if outcome.1.is_ok() && !self.keep_runs {
            tidy(&folder, &messages)?;
        }
        Ok(Some(self.record(cell, start, wall_secs, outcome)))
    }

    fn start(&self) -> Start {
        let at = Instant::now();
        let own_load = self.own_load.lock().unwrap_or_else(PoisonError::into_inner);
        Start {
            at,
            utc: machine::utc_now(),
            load1: machine::load1(),
            own_load1: machine::own_load1(&own_load, at),
        }
    }

    /// Trains; messages go to a file.
    fn train(&self, cell: &Cell, folder: &Path, messages: &Path) -> Result<End> {
        atomic_file::check_place(messages)?;
        let mut log = File::create(messages).map_err(|e| Error::io(messages, e))?;
        let mut args: Vec<OsString> =
            vec!["train".into(), cell.path.clone().into(), "--out".into(), folder.into(), "--seed".into()];
        args.extend([&*cell.seed.to_string(), "--quiet", END_WITH_STDIN].map(OsString::from));
        args.extend(with_folders(&cell.args, &cell.path, folder).into_iter().map(OsString::from));
        let process = Process {
            program: &self.program,
            args,
            timeout_secs: self.timeout_secs,
            is_stopped: &|| self.interrupt.is_requested(),
            stop: Stop::Kill,
            // A message that cannot be kept does not end the run.
            on_line: &mut |line| drop(writeln!(log, "{line}")),
        };
        process.run().map_err(|e| Error::io(&self.program, e))
    }

    /// The summary of a finished run, with the size of its file and the figures that the matrix asks for.
    fn measured(&self, cell: &Cell, folder: &Path) -> Result<Value, String> {
        let mut summary = read_summary(folder)?;
        if self.export {
            let bytes = self.exported_bytes(folder)?;
            if let Some(size) = summary.get_mut("size").and_then(Value::as_object_mut) {
                let disk = size.entry("disk").or_insert(Value::Null);
                disk["ltgs_tiny_exported"] = bytes.into();
            }
        }
        if !cell.eval.is_empty() {
            summary["eval"] = self.figures(&self.program, "eval", cell, &cell.eval, folder)?;
        }
        if !cell.figures.is_empty() {
            let this = std::env::current_exe().map_err(|e| e.to_string())?;
            summary["figures"] = self.figures(&this, "figures", cell, &cell.figures, folder)?;
        }
        Ok(summary)
    }

    /// The JSON that a command prints about a run.
    fn figures(
        &self,
        program: &Path,
        command: &str,
        cell: &Cell,
        args: &[String],
        folder: &Path,
    ) -> Result<Value, String> {
        let mut args = with_folders(args, &cell.path, folder);
        args.push("--json".to_owned());
        let printed = of_run(program, command, folder, &args)?;
        serde_json::from_slice(&printed).map_err(|e| format!("{command}: {e}"))
    }

    /// Size of the `tiny` file of a run. Its loss is measured while its steps are found, so that it needs no verification.
    fn exported_bytes(&self, folder: &Path) -> Result<u64, String> {
        let file = folder.join(EXPORTED);
        let out = file.display().to_string();
        let args = ["--quality", "tiny", "--no-verify", "--device", "cpu", "--out", &out];
        of_run(&self.program, "export", folder, &args.map(str::to_owned))?;
        fs::metadata(&file).map(|m| m.len()).map_err(|e| Error::io(&file, e).to_string())
    }

    fn record(&self, cell: &Cell, start: Start, wall_secs: f64, (exit_code, summary): Outcome) -> Record {
        let (summary, error) = match summary {
            Ok(summary) => (Some(summary), None),
            Err(error) => (None, Some(error)),
        };
        let noisy_because = self.noise(&start, summary.as_ref());
        Record {
            schema: SCHEMA.to_owned(),
            key: cell.key.clone(),
            scene: cell.scene.clone(),
            variant: cell.variant.clone(),
            budget: cell.budget.clone(),
            seed: cell.seed,
            cell: cell.index,
            args: cell.args.clone(),
            status: if summary.is_some() { Status::Ok } else { Status::Failed },
            error,
            exit_code,
            noisy: !noisy_because.is_empty(),
            noisy_because,
            load1_start: start.load1,
            load1_end: machine::load1(),
            load1_own: start.load1.map(|_| start.own_load1),
            cores: machine::cores(),
            jobs: self.jobs,
            hardware: self.hardware.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            build: self.build.clone(),
            utc: start.utc,
            wall_secs: Some(wall_secs),
            summary,
        }
    }

    /// Reasons not to trust the times of a run that has just ended; notes its own load for later runs.
    fn noise(&self, start: &Start, summary: Option<&Value>) -> Vec<String> {
        let secs =
            |clock: &str| summary.and_then(|s| s.pointer(&format!("/time/train_{clock}_secs"))?.as_f64());
        let wall_and_cpu_secs = secs("wall").zip(secs("cpu"));
        let on_cpu = summary.is_some_and(|s| s["device"]["name"] == "cpu");
        let cores = machine::cores();
        let busy_cores =
            wall_and_cpu_secs.map_or(1.0, |(wall, cpu)| (cpu / wall.max(1e-9)).clamp(0.0, cores as f64));
        self.own_load.lock().unwrap_or_else(PoisonError::into_inner).push(OwnLoad {
            from: start.at,
            to: Instant::now(),
            cores: busy_cores,
        });
        machine::noise(&Conditions {
            load1: start.load1,
            own_load1: start.own_load1,
            cores,
            jobs: self.jobs,
            wall_and_cpu_secs: wall_and_cpu_secs.filter(|_| on_cpu),
        })
    }
}

/// What a command of a program prints about a run.
fn of_run(program: &Path, command: &str, folder: &Path, args: &[String]) -> Result<Vec<u8>, String> {
    let head = [OsStr::new(command), folder.as_os_str(), OsStr::new("--quiet")];
    let words: Vec<&OsStr> = head.into_iter().chain(args.iter().map(OsStr::new)).collect();
    output(program, &words).map_err(|e| format!("{command}: {e}"))
}

/// Name of a run's folder: readable, and distinct by its key.
pub fn folder_name(names: [&str; 3], seed: u64, key: &str) -> String {
    format!("{}-{seed}-{key}", names.map(|name| plain(name, 24)).join("-"))
}

fn read_summary(folder: &Path) -> Result<Value, String> {
    let path = folder.join(SUMMARY);
    let bytes = input_file::read(&path, SUMMARY_BYTES_MAX).map_err(|e| e.to_string())?;
    serde_json::from_slice(&bytes).map_err(|e| Error::invalid(&path, e.to_string()).to_string())
}

/// Removes everything but the result and the settings.
fn tidy(folder: &Path, messages: &Path) -> Result<()> {
    let entries = fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
    for entry in entries {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        if path.is_dir() {
            remove_folder(&path)?;
        } else if !KEPT.iter().any(|name| path.ends_with(name)) {
            fs::remove_file(&path).map_err(|e| Error::io(&path, e))?;
        }
    }
    fs::remove_file(messages).map_err(|e| Error::io(messages, e))
}
