//! One run of a benchmark: a process of its own, so that memory, CPU seconds and crashes stay apart, and the
//! line of results that comes of it. Which runs there are is the matrix's business.

use super::machine::{self, Busy, Quiet};
use super::matrix::Cell;
use crate::cli::interrupt::Interrupt;
use litetex_gs::results::{Hardware, Record, SCHEMA, Status};
use litetex_gs::{Error, Result};
use serde_json::Value;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often a process is looked after.
const POLL: Duration = Duration::from_millis(20);
/// Time in which the Ctrl-C that ended a process is also told to us.
const INTERRUPT_GRACE: Duration = Duration::from_millis(500);
/// Exit code of an interrupted training.
const INTERRUPTED: i32 = 130;
/// Characters of a failed run's messages that are kept.
const ERROR_CHARS_MAX: usize = 2000;
/// What is left of a run's folder.
const KEPT: [&str; 2] = ["summary.json", "config.toml"];

/// What all runs share.
pub struct Runner {
    /// This program.
    pub program: PathBuf,
    /// Folder of the runs' folders.
    pub runs: PathBuf,
    /// Whether checkpoints, images and metrics are kept.
    pub keep_runs: bool,
    /// Runs at the same time.
    pub jobs: usize,
    /// After which a run is stopped and counts as failed.
    pub timeout_secs: Option<f64>,
    /// The user's Ctrl-C.
    pub interrupt: Interrupt,
    /// The machine.
    pub hardware: Hardware,
    /// Build of the program.
    pub build: String,
    /// Runs so far.
    pub busy: Mutex<Vec<Busy>>,
}

/// How a process ended.
enum End {
    Exit(ExitStatus),
    TimedOut,
    Interrupted,
}

impl Runner {
    /// Makes a run; `None` if the user stopped it.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder or the process cannot be made: no run of this benchmark can then. What goes
    /// wrong inside a run is a failed record.
    pub fn run(&self, cell: &Cell) -> Result<Option<Record>> {
        let folder = self.runs.join(folder_name(cell));
        let messages = folder.with_extension("log");
        remove_folder(&folder)?;
        fs::create_dir_all(&self.runs).map_err(|e| Error::io(&self.runs, e))?;
        let (started, utc, load1_start) = (Instant::now(), machine::utc_now(), machine::load1());
        let own = machine::own_load1(&self.busy.lock().unwrap_or_else(PoisonError::into_inner), started);
        let mut child = self.spawn(cell, &folder, &messages)?;
        let end = self.wait(&mut child, started).map_err(|e| Error::io(&self.program, e))?;
        let wall_secs = started.elapsed().as_secs_f64();
        let (exit_code, outcome) = match end {
            End::Interrupted => {
                remove_folder(&folder)?;
                let _ = fs::remove_file(&messages);
                return Ok(None);
            }
            End::TimedOut => (None, Err(format!("stopped after {wall_secs:.0} s: --timeout"))),
            End::Exit(status) if status.success() => (status.code(), read_summary(&folder)),
            End::Exit(status) => (status.code(), Err(last_words(&messages, status))),
        };
        let summary = outcome.as_ref().ok();
        let secs =
            |name: &str| summary.and_then(|s| s.pointer(&format!("/time/train_{name}_secs"))?.as_f64());
        let times = secs("wall").zip(secs("cpu"));
        let on_cpu = summary.is_some_and(|s| s["device"]["name"] == "cpu");
        let cores = machine::cores();
        let noisy_because = machine::noise(&Quiet {
            load1: load1_start,
            own,
            cores,
            jobs: self.jobs,
            wall_and_cpu_secs: times.filter(|_| on_cpu),
        });
        let parallel = times.map_or(1.0, |(wall, cpu)| (cpu / wall.max(1e-9)).clamp(0.0, cores as f64));
        self.busy.lock().unwrap_or_else(PoisonError::into_inner).push(Busy {
            from: started,
            to: Instant::now(),
            cores: parallel,
        });
        if outcome.is_ok() && !self.keep_runs {
            tidy(&folder, &messages)?;
        }
        Ok(Some(Record {
            schema: SCHEMA.to_owned(),
            key: cell.key.clone(),
            scene: cell.scene.clone(),
            variant: cell.variant.clone(),
            budget: cell.budget.clone(),
            seed: cell.seed,
            cell: cell.index,
            args: cell.args.clone(),
            status: if outcome.is_ok() { Status::Ok } else { Status::Failed },
            error: outcome.as_ref().err().cloned(),
            exit_code,
            noisy: !noisy_because.is_empty(),
            noisy_because,
            load1_start,
            load1_end: machine::load1(),
            load1_own: load1_start.map(|_| own),
            cores,
            jobs: self.jobs,
            hardware: self.hardware.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            build: self.build.clone(),
            utc,
            wall_secs: Some(wall_secs),
            summary: outcome.ok(),
        }))
    }

    fn spawn(&self, cell: &Cell, folder: &Path, messages: &Path) -> Result<Child> {
        let log = File::create(messages).map_err(|e| Error::io(messages, e))?;
        Command::new(&self.program)
            .arg("train")
            .arg(&cell.path)
            .arg("--out")
            .arg(folder)
            .args(["--seed", &cell.seed.to_string(), "--quiet"])
            .args(&cell.args)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .map_err(|e| Error::io(&self.program, e))
    }

    fn wait(&self, child: &mut Child, started: Instant) -> std::io::Result<End> {
        let stop = |child: &mut Child, end| {
            child.kill()?;
            child.wait()?;
            Ok(end)
        };
        loop {
            if let Some(status) = child.try_wait()? {
                // Ctrl-C goes to both processes; the other may be quicker.
                let waited = Instant::now();
                while status.code() == Some(INTERRUPTED)
                    && !self.interrupt.is_requested()
                    && waited.elapsed() < INTERRUPT_GRACE
                {
                    std::thread::sleep(POLL);
                }
                let interrupted = !status.success() && self.interrupt.is_requested();
                return Ok(if interrupted { End::Interrupted } else { End::Exit(status) });
            }
            if self.interrupt.is_requested() {
                return stop(child, End::Interrupted);
            }
            if self.timeout_secs.is_some_and(|limit| started.elapsed().as_secs_f64() > limit) {
                return stop(child, End::TimedOut);
            }
            std::thread::sleep(POLL);
        }
    }
}

/// Name of a run's folder: readable, and no two alike.
pub fn folder_name(cell: &Cell) -> String {
    let plain = |name: &str| -> String {
        let safe = name.chars().map(|c| if c.is_alphanumeric() || "-_+".contains(c) { c } else { '_' });
        safe.take(24).collect()
    };
    let names = [&cell.scene, &cell.variant, &cell.budget].map(|n| plain(n)).join("-");
    format!("{names}-{}-{}", cell.seed, cell.key)
}

fn read_summary(folder: &Path) -> Result<Value, String> {
    let path = folder.join(KEPT[0]);
    let bytes = fs::read(&path).map_err(|e| Error::io(&path, e).to_string())?;
    serde_json::from_slice(&bytes).map_err(|e| Error::invalid(&path, e.to_string()).to_string())
}

/// What a failed run said last.
fn last_words(messages: &Path, status: ExitStatus) -> String {
    let text = fs::read(messages).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    // Messages of several lines (a mistake in a TOML file) belong together.
    let from = text.rfind("error: ").unwrap_or(0);
    let words: Vec<char> = text[from..].trim().chars().collect();
    let said: String = words[words.len().saturating_sub(ERROR_CHARS_MAX)..].iter().collect();
    match (said.is_empty(), status.code()) {
        (false, Some(_)) => said.trim_start_matches("error: ").to_owned(),
        (_, Some(code)) => format!("exit code {code} without a message"),
        (_, None) => {
            format!("ended by the system ({status}); killed for memory? {said}").trim_end().to_owned()
        }
    }
}

/// Leaves the result and the settings.
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

fn remove_folder(folder: &Path) -> Result<()> {
    if folder.exists() { fs::remove_dir_all(folder).map_err(|e| Error::io(folder, e)) } else { Ok(()) }
}
