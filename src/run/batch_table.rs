//! The table of a folder of runs, `table.md` and `table.json`, written anew whenever a run begins or ends. Each run has a record
//! of its own, and the table is made of all of them: so several processes, such as the parts of a Slurm array on machines that
//! share a disk, write one table without a lock.

use super::batch::{BatchRun, RECORDS, TABLE_JSON, TABLE_MD};
use super::summary::Summary;
use crate::text::{format_count, format_duration, printable, shortened};
use crate::{Error, Result, atomic_file, input_file};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

/// Identifier and version of the schema of `table.json`.
pub const SCHEMA: &str = "litetex-runs/1";
/// Largest record that is read.
const RECORD_BYTES_MAX: u64 = 1 << 20;
/// Characters of an error in `table.md`; `table.json` has all of it.
const NOTE_CHARS_MAX: usize = 200;
/// How often the table is written again because others have changed their records meanwhile. Each time is another run that began
/// or ended within milliseconds.
const WRITES_MAX: usize = 100;

/// How a run of the table stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowStatus {
    /// It is to be trained by a batch that has begun; if none is running, the batch ended before.
    NotStarted,
    /// It has begun; if nothing is running, it was killed together with the batch.
    Started,
    /// It has its result.
    Done,
    /// It has not.
    Failed,
    /// The user ended it; what it had is saved.
    Interrupted,
}

impl RowStatus {
    /// The status as `table.json` has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotStarted => "not-started",
            Self::Started => "started",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Interrupted => "interrupted",
        }
    }
}

/// A run in the table. Figures are null until it is done, and those of the test views without any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name of the run's folder.
    pub run: String,
    /// The capture's path, absolute.
    pub capture: PathBuf,
    /// Place in the list of captures, from 1.
    pub position: usize,
    /// How it stands.
    pub status: RowStatus,
    /// Exit code of its training; null if there is none, as after a kill.
    pub exit_code: Option<i32>,
    /// What made it fail.
    pub error: Option<String>,
    /// PSNR of the test views, dB.
    pub psnr: Option<f64>,
    /// Gradient-PSNR of the test views, dB.
    pub grad_psnr: Option<f64>,
    /// Steps done.
    pub steps: Option<u32>,
    /// Number of splats.
    pub splats: Option<usize>,
    /// Floats that the model holds.
    pub params: Option<usize>,
    /// Size of the scene as a `.ltgs` file of balanced quality.
    pub ltgs_balanced_bytes: Option<usize>,
    /// Time from start to end, all processes of the run together.
    pub total_wall_secs: Option<f64>,
    /// Codes of its warnings.
    pub warnings: Vec<String>,
}

impl Row {
    /// A run whose turn has not come.
    pub fn not_started(run: &BatchRun) -> Self {
        Self { status: RowStatus::NotStarted, ..Self::started(run) }
    }

    /// A run that has begun.
    pub fn started(run: &BatchRun) -> Self {
        Self {
            run: run.name.clone(),
            capture: std::path::absolute(&run.capture).unwrap_or_else(|_| run.capture.clone()),
            position: run.index + 1,
            status: RowStatus::Started,
            exit_code: None,
            error: None,
            psnr: None,
            grad_psnr: None,
            steps: None,
            splats: None,
            params: None,
            ltgs_balanced_bytes: None,
            total_wall_secs: None,
            warnings: Vec::new(),
        }
    }

    /// The run with its result.
    pub fn done(run: &BatchRun, summary: &Summary) -> Self {
        let quality = summary.quality.as_ref().map(|quality| &quality.evaluation);
        Self {
            status: RowStatus::Done,
            exit_code: Some(0),
            psnr: quality.map(|q| q.psnr),
            grad_psnr: quality.map(|q| q.grad_psnr),
            steps: Some(summary.steps),
            splats: Some(summary.size.splats),
            params: Some(summary.size.params),
            ltgs_balanced_bytes: summary.size.disk.as_ref().map(|disk| disk.ltgs_balanced),
            total_wall_secs: Some(summary.time.total_wall_secs),
            warnings: summary.warnings.iter().map(|w| w.code.clone()).collect(),
            ..Self::started(run)
        }
    }

    /// The run with what made it fail.
    pub fn failed(run: &BatchRun, exit_code: Option<i32>, error: String) -> Self {
        Self { status: RowStatus::Failed, exit_code, error: Some(error), ..Self::started(run) }
    }

    /// The run that the user ended.
    pub fn interrupted(run: &BatchRun) -> Self {
        Self {
            status: RowStatus::Interrupted,
            exit_code: Some(Error::Interrupted.exit_code().into()),
            ..Self::started(run)
        }
    }

    /// What is to be said about it.
    pub fn note(&self) -> String {
        match &self.error {
            Some(error) => shortened(error.lines().next().unwrap_or_default(), NOTE_CHARS_MAX).into_owned(),
            None => self.warnings.join(", "),
        }
    }

    /// Its figures as people read them: those under the heads of [`BatchTable::HEAD`] between status and note.
    pub fn figures(&self) -> [String; 5] {
        let dash = || "-".to_owned();
        let decibels = |x: Option<f64>| x.map_or_else(dash, |x| format!("{x:.2}"));
        let count = |n: Option<usize>| n.map_or_else(dash, |n| format_count(n as u64));
        [
            decibels(self.psnr),
            decibels(self.grad_psnr),
            count(self.splats),
            count(self.params),
            self.total_wall_secs.map_or_else(dash, format_duration),
        ]
    }
}

/// The table of a folder of runs.
#[derive(Debug)]
pub struct BatchTable {
    folder: PathBuf,
}

impl BatchTable {
    /// Heads of the columns of `table.md`.
    pub const HEAD: [&str; 8] =
        ["Run", "Status", "PSNR", "Gradient-PSNR", "Splats", "Parameters", "Time", "Note"];

    /// The table of a folder, which is made.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Usage`] where something else has the name of one of its files.
    pub fn open(folder: &Path) -> Result<Self> {
        let records = folder.join(RECORDS);
        fs::create_dir_all(&records).map_err(|e| Error::io(&records, e))?;
        [TABLE_MD, TABLE_JSON].iter().try_for_each(|name| atomic_file::check_place(&folder.join(name)))?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// Path of the table for people.
    pub fn markdown(&self) -> PathBuf {
        self.folder.join(TABLE_MD)
    }

    /// Records how a run stands, and writes the table of all runs of the folder.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn record(&self, row: &Row) -> Result<()> {
        self.keep(row)?;
        self.write()
    }

    fn keep(&self, row: &Row) -> Result<()> {
        let record = self.folder.join(RECORDS).join(format!("{}.json", row.run));
        atomic_file::write(
            &record,
            &serde_json::to_vec_pretty(row).map_err(|e| Error::io(&record, e.into()))?,
        )?;
        Ok(())
    }

    /// Records runs whose turn has not come. What is known of them from before stays.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn expect(&self, runs: &[BatchRun]) -> Result<()> {
        let known = self.rows()?;
        let is_new = |run: &&BatchRun| known.iter().all(|row| row.run != run.name);
        runs.iter().filter(is_new).try_for_each(|run| self.keep(&Row::not_started(run)))?;
        self.write()
    }

    /// Writes the table anew, until it has what the records say at its end: whoever writes last has seen all of them.
    fn write(&self) -> Result<()> {
        let mut rows = self.rows()?;
        for _ in 0..WRITES_MAX {
            let json = serde_json::to_string_pretty(&to_json(&rows));
            let path = self.folder.join(TABLE_JSON);
            let json = json.map_err(|e| Error::io(&path, e.into()))? + "\n";
            atomic_file::write(&path, json.as_bytes())?;
            atomic_file::write(&self.markdown(), to_markdown(&rows).as_bytes())?;
            let now = self.rows()?;
            if now == rows {
                break;
            }
            rows = now;
        }
        Ok(())
    }

    /// All runs of the folder in the order of their captures. A record that cannot be read is left out.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn rows(&self) -> Result<Vec<Row>> {
        let folder = self.folder.join(RECORDS);
        let entries = fs::read_dir(&folder).map_err(|e| Error::io(&folder, e))?;
        let paths = entries.flatten().map(|entry| entry.path());
        // Temporary names begin with a dot and end otherwise.
        let paths = paths.filter(|path| path.extension().is_some_and(|e| e == "json"));
        let read =
            |path: PathBuf| serde_json::from_slice(&input_file::read(&path, RECORD_BYTES_MAX).ok()?).ok();
        let mut rows: Vec<Row> = paths.filter_map(read).collect();
        rows.sort_by(|a, b| (a.position, &a.run).cmp(&(b.position, &b.run)));
        Ok(rows)
    }
}

/// The table as `table.json` has it, and `litetex train --json` prints it.
pub fn to_json(rows: &[Row]) -> Value {
    json!({ "schema": SCHEMA, "version": env!("CARGO_PKG_VERSION"), "runs": rows })
}

fn to_markdown(rows: &[Row]) -> String {
    let line = |cells: &[String]| {
        let cells: Vec<String> = cells.iter().map(|cell| escaped(cell)).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let mut text = String::from("# Runs\n\n");
    text += &line(&BatchTable::HEAD.map(str::to_owned));
    text += "|---|---|---:|---:|---:|---:|---:|---|\n";
    for row in rows {
        let mut cells = vec![row.run.clone(), row.status.name().to_owned()];
        cells.extend(row.figures());
        cells.push(row.note());
        text += &line(&cells);
    }
    let count = |status| rows.iter().filter(|row| row.status == status).count();
    let others = [RowStatus::Failed, RowStatus::Interrupted, RowStatus::Started, RowStatus::NotStarted]
        .map(|s| (count(s), s.name()));
    text += &format!("\n{} of {} done", count(RowStatus::Done), rows.len());
    for (count, name) in others.into_iter().filter(|(count, _)| *count > 0) {
        text += &format!(", {count} {name}");
    }
    text + ". PSNR in dB, of the test views. `table.json` has more.\n"
}

/// A cell that stays one: names of folders and messages may hold anything.
fn escaped(cell: &str) -> String {
    printable(cell, &[]).replace('\\', "\\\\").replace('|', "\\|").replace(['<', '`'], "'")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::batch_runs;

    fn runs(count: usize) -> Vec<BatchRun> {
        let captures: Vec<PathBuf> = (0..count).map(|i| PathBuf::from(format!("captures/c{i}"))).collect();
        batch_runs(&captures, Path::new("runs"))
    }

    #[test]
    fn the_table_grows_and_keeps_the_order_of_the_list() {
        let dir = tempfile::tempdir().unwrap();
        let table = BatchTable::open(dir.path()).unwrap();
        let runs = runs(12);
        table.record(&Row::failed(&runs[11], Some(3), "a | b: no\nsuch".to_owned())).unwrap();
        table.record(&Row::started(&runs[2])).unwrap();
        table.record(&Row::interrupted(&runs[2])).unwrap();
        let text = fs::read_to_string(table.markdown()).unwrap();
        let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("| c")).collect();
        assert_eq!(lines[0], "| c2 | interrupted | - | - | - | - | - |  |");
        assert_eq!(lines[1], "| c11 | failed | - | - | - | - | - | a \\| b: no |");
        assert!(lines.len() == 2 && text.contains("0 of 2 done, 1 failed, 1 interrupted."), "{text}");
        let json: Value = serde_json::from_slice(&fs::read(dir.path().join(TABLE_JSON)).unwrap()).unwrap();
        assert_eq!(json["schema"], SCHEMA);
        assert_eq!((&json["runs"][1]["exit_code"], &json["runs"][0]["exit_code"]), (&3.into(), &130.into()));
        assert_eq!(json["runs"][1]["error"], "a | b: no\nsuch");
    }

    #[test]
    fn runs_whose_turn_has_not_come_are_counted_and_keep_what_is_known() {
        let dir = tempfile::tempdir().unwrap();
        let table = BatchTable::open(dir.path()).unwrap();
        let runs = runs(3);
        table.record(&Row::failed(&runs[1], Some(3), "no".to_owned())).unwrap();
        table.expect(&runs).unwrap();
        table.record(&Row::interrupted(&runs[0])).unwrap();
        let status: Vec<RowStatus> = table.rows().unwrap().iter().map(|row| row.status).collect();
        assert_eq!(status, [RowStatus::Interrupted, RowStatus::Failed, RowStatus::NotStarted]);
        let text = fs::read_to_string(table.markdown()).unwrap();
        assert!(text.contains("0 of 3 done, 1 failed, 1 interrupted, 1 not-started."), "{text}");
    }

    #[test]
    fn processes_that_write_at_once_lose_no_row() {
        let dir = tempfile::tempdir().unwrap();
        let runs = runs(40);
        std::thread::scope(|scope| {
            for part in runs.chunks(10) {
                let table = BatchTable::open(dir.path()).unwrap();
                scope
                    .spawn(move || part.iter().for_each(|run| table.record(&Row::interrupted(run)).unwrap()));
            }
        });
        let json: Value = serde_json::from_slice(&fs::read(dir.path().join(TABLE_JSON)).unwrap()).unwrap();
        assert_eq!(json["runs"].as_array().unwrap().len(), 40);
        let text = fs::read_to_string(dir.path().join(TABLE_MD)).unwrap();
        assert_eq!(text.lines().filter(|line| line.starts_with("| c")).count(), 40);
    }

    #[test]
    fn damaged_records_and_taken_names_do_no_harm() {
        let dir = tempfile::tempdir().unwrap();
        let table = BatchTable::open(dir.path()).unwrap();
        fs::write(dir.path().join(RECORDS).join("x.json"), "{").unwrap();
        table.record(&Row::started(&runs(1)[0])).unwrap();
        assert_eq!(table.rows().unwrap().len(), 1);
        let other = tempfile::tempdir().unwrap();
        fs::create_dir(other.path().join(TABLE_MD)).unwrap();
        assert_eq!(BatchTable::open(other.path()).unwrap_err().exit_code(), 2);
    }
}
