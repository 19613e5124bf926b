//! The folder of a benchmark: its lock, its results, and what --force may delete.

use super::args::BenchArgs;
use super::captures::{self, CAPTURES};
use litetex_gs::console::Log;
use litetex_gs::{Error, Result, atomic_file};
use litetex_lab::results::{self, Record};
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
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
        e.is_ok_and(|e| [RUNS, CAPTURES, LOCK].iter().any(|name| e.file_name() == *name))
    };
    let is_empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.all(is_ours));
    if !(is_empty || file.exists() || args.force || args.resume) {
        return Err(Error::Usage(format!(
            "{}: the folder is not empty and contains no {RESULTS}; choose another, or add --force, which leaves \
             other files alone",
            folder.display()
        )));
    }
    atomic_file::check_place(file)?;
    check_results(folder, file)?;
    if args.force {
        check_ours(folder)?;
    }
    if args.dry_run {
        return Ok((if args.force { Vec::new() } else { read_results(file, log)? }, None));
    }
    let lock = lock(folder)?;
    if args.force {
        if file.exists() {
            std::fs::remove_file(file).map_err(|e| Error::io(file, e))?;
        }
        remove_runs(&folder.join(RUNS))?;
        captures::remove_all(&folder.join(CAPTURES))?;
    }
    Ok((read_results(file, log)?, Some(lock)))
}

/// Refuses results of which none is usable, where no benchmark has left its lock file: someone else's. With the lock, a
/// power cut may have left half a line.
fn check_results(folder: &Path, file: &Path) -> Result<()> {
    if !file.exists() || folder.join(LOCK).exists() {
        return Ok(());
    }
    let (records, found) = results::read(file)?;
    if !records.is_empty() {
        return Ok(());
    }
    let why = found.warnings.first().map_or("it is empty".to_owned(), |w| w.message.clone());
    Err(Error::Usage(format!(
        "{}: no usable results, so litetex-lab bench did not create it: {why}; choose another folder",
        file.display()
    )))
}

/// Refuses to delete results and runs where no benchmark has left its lock file.
fn check_ours(folder: &Path) -> Result<()> {
    let found = [RESULTS, RUNS].into_iter().find(|name| folder.join(name).exists());
    match found {
        Some(name) if !folder.join(LOCK).exists() => Err(Error::Usage(format!(
            "{}: contains {name} but no {LOCK}, so litetex-lab bench did not create it and --force does not delete it; \
             choose another folder",
            folder.display()
        ))),
        _ => Ok(()),
    }
}

/// Removes the runs' folders and messages, and nothing else that may be among them.
fn remove_runs(runs: &Path) -> Result<()> {
    let entries = match std::fs::read_dir(runs) {
        Ok(entries) => entries,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(()),
        Err(e) => return Err(Error::io(runs, e)),
    };
    for entry in entries {
        let path = entry.map_err(|e| Error::io(runs, e))?.path();
        if !path.file_name().and_then(|n| n.to_str()).is_some_and(is_name_of_run) {
            continue;
        }
        let removed =
            if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        removed.map_err(|e| Error::io(&path, e))?;
    }
    Ok(())
}

/// Whether a name ends like those of [`super::runner::folder_name`]: in a key of 16 hexadecimal digits.
fn is_name_of_run(name: &str) -> bool {
    let key = name.trim_end_matches(".log").rsplit('-').next().unwrap_or_default();
    key.len() == 16 && key.len() < name.len() && key.bytes().all(|b| b.is_ascii_hexdigit())
}

/// Keeps other benchmarks out of the folder until the lock is dropped.
fn lock(folder: &Path) -> Result<File> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let path = folder.join(LOCK);
    atomic_file::check_place(&path)?;
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
    let (records, report) = results::read(file)?;
    log.report(&report);
    Ok(results::latest(records))
}
