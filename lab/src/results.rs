//! `results.jsonl`: one line per run of a benchmark, documented in `lab/results-schema.md`. A file may end in half a
//! line, come from another version or be edited by hand; lines that cannot be used are skipped with a warning.

use litetex_gs::{Error, Report, Result, input_file};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Identifier and version of the schema.
pub const SCHEMA: &str = "litetex-results/2";

/// Largest figure that counts, in any unit: a single larger one of damaged results would ruin every mean and every axis.
const FIGURE_MAX: f64 = 1e15;

/// Whether a run has a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The run ended with a summary.
    Ok,
    /// The run ended with an error.
    Failed,
}

/// The machine that a run was made on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default)]
pub struct Hardware {
    /// Processor model; empty where the system does not report it.
    pub cpu: String,
    /// Physical memory.
    pub memory_bytes: Option<u64>,
    /// Operating system, its version and the processor architecture.
    pub os: String,
}

/// A line of `results.jsonl`: one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// Hash of scene, arguments, seed and version: equal for runs that should give the same result.
    pub key: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the variant.
    pub variant: String,
    /// Name of the budget.
    pub budget: String,
    /// Seed of the run.
    pub seed: u64,
    /// Index of the run in its matrix.
    #[serde(default)]
    pub cell: usize,
    /// Arguments of `litetex train` besides capture, output folder and seed.
    #[serde(default)]
    pub args: Vec<String>,
    /// Whether the run succeeded.
    pub status: Status,
    /// Last message of a failed run.
    pub error: Option<String>,
    /// Exit code of the process; null if a signal ended it.
    pub exit_code: Option<i32>,
    /// Whether the machine was too busy for its times to be trusted.
    #[serde(default)]
    pub noisy: bool,
    /// Reasons for `noisy`.
    #[serde(default)]
    pub noisy_because: Vec<String>,
    /// One-minute load average at the start; null where the system does not report it.
    pub load1_start: Option<f64>,
    /// One-minute load average at the end.
    pub load1_end: Option<f64>,
    /// Estimated part of `load1_start` that earlier runs of the benchmark caused.
    pub load1_own: Option<f64>,
    /// Processor cores that the program may use.
    #[serde(default)]
    pub cores: usize,
    /// Number of runs made at the same time.
    #[serde(default)]
    pub jobs: usize,
    /// The machine that made the run.
    #[serde(default)]
    pub hardware: Hardware,
    /// Version of the program.
    #[serde(default)]
    pub version: String,
    /// CRC-32 of the program's file, to distinguish builds of one version.
    #[serde(default)]
    pub build: String,
    /// Start of the run, RFC 3339.
    #[serde(default)]
    pub utc: String,
    /// Lifetime of the process.
    pub wall_secs: Option<f64>,
    /// The run's `summary.json`; null if it failed.
    pub summary: Option<Value>,
}

impl Record {
    /// Names and seed of the run, for messages.
    pub fn describe(&self) -> String {
        format!(
            "scene {:?}, variant {:?}, budget {:?}, seed {}",
            self.scene, self.variant, self.budget, self.seed
        )
    }

    /// What is at a JSON pointer into the summary such as `/quality/psnr`.
    pub fn value(&self, pointer: &str) -> Option<&Value> {
        self.summary.as_ref()?.pointer(pointer)
    }

    /// The number at a JSON pointer into the summary; `None` if it is missing or implausible.
    pub fn number(&self, pointer: &str) -> Option<f64> {
        plausible(self.value(pointer)?)
    }

    /// The points of the list at a JSON pointer that have all of these numbers.
    pub fn points<const N: usize>(&self, pointer: &str, keys: [&str; N]) -> Vec<[f64; N]> {
        let points = self.value(pointer).and_then(Value::as_array).into_iter().flatten();
        let point = |p: &Value| {
            let numbers: Option<Vec<f64>> = keys.iter().map(|key| plausible(p.get(key)?)).collect();
            numbers?.try_into().ok()
        };
        points.filter_map(point).collect()
    }
}

fn plausible(value: &Value) -> Option<f64> {
    value.as_f64().filter(|x| x.abs() <= FIGURE_MAX)
}

/// Appends a line in one write, on a line of its own even if an interrupted write left half a line.
///
/// # Errors
/// [`Error::Io`] naming `path`.
pub fn append(path: &Path, record: &Record) -> Result<()> {
    let io = |e| Error::io(path, e);
    let json = serde_json::to_string(record).map_err(|e| io(e.into()))?;
    let mut file = File::options().read(true).append(true).create(true).open(path).map_err(io)?;
    let mut last = [b'\n'];
    if file.metadata().map_err(io)?.len() > 0 {
        file.seek(SeekFrom::End(-1)).and_then(|_| file.read_exact(&mut last)).map_err(io)?;
    }
    let before = if last == [b'\n'] { "" } else { "\n" };
    file.write_all(format!("{before}{json}\n").as_bytes()).and_then(|()| file.sync_data()).map_err(io)
}

/// Reads the usable lines of a file, in order, with warnings about the others.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::InvalidInput`] if it is a folder, a device or a pipe.
pub fn read(path: &Path) -> Result<(Vec<Record>, Report)> {
    let bytes = input_file::read(path, u64::MAX)?;
    Ok(parse(&path.display().to_string(), &bytes))
}

/// Like [`read`], from memory; `name` stands for the file in warnings.
pub fn parse(name: &str, bytes: &[u8]) -> (Vec<Record>, Report) {
    let mut records = Vec::new();
    let mut skipped: Vec<(&str, usize, String)> = Vec::new();
    for (index, line) in bytes.split(|&b| b == b'\n').enumerate() {
        if line.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        match parse_line(line) {
            Ok(record) => records.push(record),
            Err((code, why)) => skipped.push((code, index + 1, why)),
        }
    }
    let mut report = Report::default();
    for code in ["results-broken-lines", "results-other-schema"] {
        let lines: Vec<_> = skipped.iter().filter(|(c, ..)| *c == code).collect();
        if let Some((_, line, why)) = lines.first() {
            let more = match lines.len() {
                1 => String::new(),
                n => format!(" and {} more lines", n - 1),
            };
            report.warn(code, lines.len(), format!("{name}: line {line}{more} skipped: {why}"));
        }
    }
    (records, report)
}

fn parse_line(line: &[u8]) -> Result<Record, (&'static str, String)> {
    let broken = |e: serde_json::Error| ("results-broken-lines", e.to_string());
    let value: Value = serde_json::from_slice(line).map_err(broken)?;
    match value.get("schema").and_then(Value::as_str) {
        Some(SCHEMA) => serde_json::from_value(value).map_err(broken),
        found => {
            let found = found.map_or("no schema".to_owned(), |s| format!("schema {s:?}"));
            Err(("results-other-schema", format!("found {found}, expected {SCHEMA:?}")))
        }
    }
}

/// Keeps the last record of each key, in the position of the first.
pub fn latest(records: Vec<Record>) -> Vec<Record> {
    let mut places = HashMap::new();
    let mut out: Vec<Record> = Vec::new();
    for record in records {
        match places.get(&record.key) {
            Some(&place) => out[place] = record,
            None => {
                places.insert(record.key.clone(), out.len());
                out.push(record);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(key: &str, seed: u64) -> Record {
        let line = format!(
            r#"{{"schema":"{SCHEMA}","key":"{key}","scene":"s","variant":"v","budget":"b","seed":{seed},
               "status":"ok","summary":{{"quality":{{"psnr":20.5,"flip":null,"ssim":1e308}}}}}}"#
        );
        let (records, report) = parse("x", line.replace('\n', " ").as_bytes());
        assert!(report.warnings.is_empty(), "{report:?}");
        records.into_iter().next().unwrap()
    }

    #[test]
    fn most_fields_are_optional_and_null_and_the_implausible_are_missing_values() {
        let record = record("k", 3);
        assert_eq!((record.seed, record.status), (3, Status::Ok));
        assert_eq!(record.number("/quality/psnr"), Some(20.5));
        assert_eq!(record.number("/quality/flip"), None);
        assert_eq!(record.number("/quality/ssim"), None);
    }

    #[test]
    fn appending_after_half_a_line_keeps_both_neighbours_readable() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("results.jsonl");
        append(&path, &record("a", 1)).unwrap();
        let mut file = File::options().append(true).open(&path).unwrap();
        file.write_all(br#"{"schema":"litetex-results/2","ke"#).unwrap();
        append(&path, &record("b", 2)).unwrap();
        let (records, report) = read(&path).unwrap();
        assert_eq!(records, [record("a", 1), record("b", 2)]);
        assert_eq!(report.warnings.len(), 1);
        assert!(report.warnings[0].message.contains("line 2"), "{report:?}");
    }

    #[test]
    fn unusable_lines_are_counted_by_reason() {
        let text = b"{\"schema\":\"litetex-results/9\"}\n{}\n\n[1]\nnonsense\n{\"schema\":\"litetex-results/2\"}\n\xff\xfe\n{\"x\":NaN}";
        let (records, report) = parse("r.jsonl", text);
        assert!(records.is_empty());
        let counts: Vec<_> = report.warnings.iter().map(|w| (w.code.as_str(), w.count)).collect();
        assert_eq!(counts, [("results-broken-lines", 4), ("results-other-schema", 3)]);
        assert!(report.warnings[1].message.contains("litetex-results/9"), "{report:?}");
    }

    #[test]
    fn the_last_line_of_a_key_takes_the_position_of_the_first() {
        let all = vec![record("a", 1), record("b", 2), record("a", 3)];
        let seeds: Vec<u64> = latest(all).iter().map(|r| r.seed).collect();
        assert_eq!(seeds, [3, 2]);
    }
}
