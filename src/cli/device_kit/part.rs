//! A part of the kit: this program, called with other arguments, in a process of its own, so that a driver that
//! crashes or hangs takes nothing else with it. What it prints goes to `NAME.out` and `NAME.err`, its figures to
//! `NAME.json` (measured kernels) or `NAME/summary.json` (training).

use litetex_gs::{Error, Result};
use serde_json::Value;
use std::ffi::OsString;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How a part ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// With exit code 0.
    Passed,
    /// Too much for this device in this time; and why.
    Skipped(String),
    /// With a code, if it ended by itself; and why.
    Failed(Option<i32>, String),
}

/// A part that is over.
pub struct Part {
    pub name: String,
    pub outcome: Outcome,
    pub secs: f64,
    /// Standard output.
    pub out: String,
    /// What it wrote; null if nothing.
    pub figures: Value,
}

/// Time between two looks at a part that runs.
const LOOK: Duration = Duration::from_millis(20);

impl Part {
    /// One that was not begun.
    pub fn skipped(name: &str, why: String) -> Self {
        Self {
            name: name.to_owned(),
            outcome: Outcome::Skipped(why),
            secs: 0.0,
            out: String::new(),
            figures: Value::Null,
        }
    }

    /// Runs one; after `limit_secs` it is stopped.
    ///
    /// # Errors
    /// [`Error::Io`] if its files or its process cannot be made.
    pub fn run(folder: &Path, name: &str, limit_secs: f64, args: &[OsString]) -> Result<Self> {
        let file = |ending: &str| folder.join(format!("{name}.{ending}"));
        let figures = [file("json"), folder.join(name).join("summary.json")];
        for earlier in &figures {
            match fs::remove_file(earlier) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io(earlier, e)),
                _ => {}
            }
        }
        let create = |path: &Path| File::create(path).map_err(|e| Error::io(path, e));
        let (out, err) = (file("out"), file("err"));
        let program = std::env::current_exe().map_err(|e| Error::io("litetex", e))?;
        let start = Instant::now();
        let mut child = Command::new(&program)
            .args(args)
            .stdin(Stdio::null())
            .stdout(create(&out)?)
            .stderr(create(&err)?)
            .spawn()
            .map_err(|e| Error::io(&program, e))?;
        let status = loop {
            if let Some(status) = child.try_wait().map_err(|e| Error::io(&program, e))? {
                break Some(status);
            }
            if start.elapsed().as_secs_f64() > limit_secs {
                // It may have ended just now; either way there is nothing left to wait for.
                let _ = child.kill();
                let _ = child.wait();
                break None;
            }
            std::thread::sleep(LOOK);
        };
        let secs = start.elapsed().as_secs_f64();
        // What a part that failed early has not written is empty.
        let read = |path: &Path| fs::read_to_string(path).unwrap_or_default();
        let figures = figures.iter().find_map(|path| serde_json::from_str(&read(path)).ok());
        let figures: Value = figures.unwrap_or(Value::Null);
        let outcome = outcome(status, secs, &read(&err), &figures);
        Ok(Self { name: name.to_owned(), outcome, secs, out: read(&out), figures })
    }

    /// What is said of it beside how it ended.
    pub fn message(&self) -> &str {
        match &self.outcome {
            Outcome::Passed => "",
            Outcome::Skipped(why) | Outcome::Failed(_, why) => why,
        }
    }
}

fn outcome(status: Option<ExitStatus>, secs: f64, errors: &str, figures: &Value) -> Outcome {
    let Some(status) = status else {
        return Outcome::Failed(None, format!("stopped after {secs:.0} s: its time was over"));
    };
    if status.success() {
        return figures["skipped"].as_str().map_or(Outcome::Passed, |why| Outcome::Skipped(why.to_owned()));
    }
    let last = errors.lines().rfind(|line| !line.trim().is_empty());
    Outcome::Failed(status.code(), last.map_or_else(|| status.to_string(), str::to_owned))
}
