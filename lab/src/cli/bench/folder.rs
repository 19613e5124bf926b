//! The folder of a benchmark: its lock, its results, and what --force may delete.

use super::args::BenchArgs;
use litetex_gs::console::Log;
use litetex_gs::{Error, Result, atomic_file};
use litetex_lab::results::{self, Record};
use std::fs::{self, File, TryLockError};
use std::path::Path;

/// Folder of the captures in the folder of the benchmark.
pub const CAPTURES: &str = "captures";

/// Names in the folder: results, the folder of the runs, and the file that is locked while a benchmark uses the folder.
pub const RESULTS: &str = "results.jsonl";
pub const RUNS: &str = "runs";
const LOCK: &str = ".bench.lock";
/// Hexadecimal digits at the end of the names of runs, which are their keys, and of captures.
const KEY_DIGITS: usize = 16;
const CAPTURE_DIGITS: usize = 8;

/// Returns the results so far and the lock of the folder; refuses a folder with other contents.
pub fn open(args: &BenchArgs, file: &Path, log: &Log) -> Result<(Vec<Record>, Option<File>)> {
    let folder = &args.out;
    if folder.is_file() {
        return Err(Error::Usage(format!("{}: is a file, not a folder", folder.display())));
    }
    // A benchmark that was stopped during its first run leaves no results.
    let is_ours = |e: std::io::Result<fs::DirEntry>| {
        e.is_ok_and(|e| [RUNS, CAPTURES, LOCK].iter().any(|name| e.file_name() == *name))
    };
    let is_empty = fs::read_dir(folder).map_or(true, |mut entries| entries.all(is_ours));
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
            fs::remove_file(file).map_err(|e| Error::io(file, e))?;
        }
        remove_made(&folder.join(RUNS), KEY_DIGITS)?;
        remove_made(&folder.join(CAPTURES), CAPTURE_DIGITS)?;
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

/// Removes what a benchmark has made in a folder, and nothing else that may be there: names that end in a hash of this many
/// hexadecimal digits.
fn remove_made(folder: &Path, digits: usize) -> Result<()> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for entry in entries {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        let stem = name.trim_end_matches(".log").trim_end_matches(".part");
        let is_hash = |hash: &str| hash.len() == digits && hash.bytes().all(|b| b.is_ascii_hexdigit());
        if !stem.rsplit_once('-').is_some_and(|(_, hash)| is_hash(hash)) {
            continue;
        }
        if path.is_dir() {
            remove_folder(&path)?;
        } else {
            fs::remove_file(&path).map_err(|e| Error::io(&path, e))?;
        }
    }
    Ok(())
}

/// Removes a folder with everything in it, if it is there.
pub fn remove_folder(folder: &Path) -> Result<()> {
    if folder.is_dir() { fs::remove_dir_all(folder).map_err(|e| Error::io(folder, e)) } else { Ok(()) }
}

/// The beginning of a name as a part of a file name.
pub fn plain(name: &str, chars_max: usize) -> String {
    let safe = name.chars().map(|c| if c.is_alphanumeric() || "-_+".contains(c) { c } else { '_' });
    safe.take(chars_max).collect()
}

/// Keeps other benchmarks out of the folder until the lock is dropped.
fn lock(folder: &Path) -> Result<File> {
    fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
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
