//! The folder of a benchmark: who may use it, and the results in it.

use super::BenchArgs;
use crate::cli::lab;
use crate::cli::log::Log;
use litetex_gs::{Error, Result};
use litetex_lab::results::{self, Record};
use std::fs::{File, TryLockError};
use std::path::Path;

/// Names in the folder: results, the folder of the runs, and the file that is locked while a benchmark uses the folder.
pub const RESULTS: &str = "results.jsonl";
pub const RUNS: &str = "runs";
const LOCK: &str = ".bench.lock";

/// Returns the results so far and the lock of the folder; refuses a folder with other contents.
pub fn open(args: &BenchArgs, file: &Path, log: &Log) -> Result<(Vec<Record>, Option<File>)> {
    let folder = &args.out;
    if folder.is_file() {
        return Err(Error::Usage(format!("{}: is a file, not a folder", folder.display())));
    }
    // A benchmark that was stopped during its first run leaves no results.
    let is_ours = |e: std::io::Result<std::fs::DirEntry>| {
        e.is_ok_and(|e| e.file_name() == RUNS || e.file_name() == LOCK)
    };
    let is_empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.all(is_ours));
    if !(is_empty || file.exists() || args.force || args.resume) {
        return Err(Error::Usage(format!(
            "{}: the folder is not empty and contains no {RESULTS}; choose another, or add --force, which leaves \
             other files alone",
            folder.display()
        )));
    }
    if args.dry_run {
        return Ok((if args.force { Vec::new() } else { read_results(file, log)? }, None));
    }
    let lock = lock(folder)?;
    if args.force {
        let runs = folder.join(RUNS);
        if file.exists() {
            std::fs::remove_file(file).map_err(|e| Error::io(file, e))?;
        }
        if runs.exists() {
            std::fs::remove_dir_all(&runs).map_err(|e| Error::io(&runs, e))?;
        }
    }
    Ok((read_results(file, log)?, Some(lock)))
}

/// Keeps other benchmarks out of the folder until the lock is dropped.
fn lock(folder: &Path) -> Result<File> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let path = folder.join(LOCK);
    let file = File::create(&path).map_err(|e| Error::io(&path, e))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(Error::Usage(format!(
            "{}: another benchmark is using this folder; wait for it, or choose another folder",
            folder.display()
        ))),
        // Not every file system can lock; there it is up to the user.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
    }
}

/// Reads the results so far, the last line of each key.
///
/// # Errors
/// [`Error::Io`].
pub fn read_results(file: &Path, log: &Log) -> Result<Vec<Record>> {
    if !file.exists() {
        return Ok(Vec::new());
    }
    let (records, report) = results::read(file).map_err(lab::error)?;
    log.report(&lab::report(report));
    Ok(results::latest(records))
}
