//! Staging folders: created and locked by a running process, cleaned up after one that died.

use super::steps::Steps;
use super::swap::{Places, Swap};
use crate::file::temporary_name;
use crate::{Error, Result, text};
use std::fs::{self, File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Locked by the process that made the folder, for as long as it lives. The system unlocks it whatever ends the process.
const LOCK: &str = "lock";

/// A folder without a lock may be one that is just being made.
const MAKING_TIME: Duration = Duration::from_secs(60);

/// Who found a staging folder.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Caller {
    /// Is about to write next to it, and also deletes what no process will use again.
    Writer,
    /// Needs an asset whose files belong together.
    Reader,
}

/// Makes a folder next to a file, on the same file system, and locks it: moving out of it is one step.
pub(super) fn fresh(path: &Path) -> Result<(PathBuf, Option<File>)> {
    loop {
        let folder = temporary_name(path);
        match fs::create_dir(&folder) {
            Ok(()) => {}
            // Left behind by a process of this number that was killed.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => continue,
            Err(e) => return Err(Error::io(path, e)),
        }
        let lock = File::create(folder.join(LOCK)).map_err(|e| Error::io(path, e))?;
        match lock.try_lock() {
            Ok(()) => return Ok((folder, Some(lock))),
            // Another process takes it for abandoned.
            Err(TryLockError::WouldBlock) => {}
            // A system without locks: the folder cannot be taken for abandoned.
            Err(TryLockError::Error(_)) => return Ok((folder, None)),
        }
    }
}

/// Deletes a staging folder, the lock last: a folder with a lock and without a journal can be deleted.
pub(super) fn remove(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten().filter(|e| e.file_name() != LOCK) {
        let _ = fs::remove_dir_all(entry.path()).or_else(|_| fs::remove_file(entry.path()));
    }
    let _ = fs::remove_file(folder.join(LOCK));
    // What cannot be removed now cannot be removed later.
    let _ = fs::remove_dir(folder);
}

/// Finishes the move of the asset at `path` if a process was killed in it, so that old and new files do not stay mixed.
/// For writers, also deletes all folders next to it that dead processes have left behind. Folders of living processes stay.
///
/// # Errors
/// [`Error::Io`] if an asset is left mixed.
pub(crate) fn repair(path: &Path, caller: Caller) -> Result<()> {
    let place = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Some(name) = path.file_name().map(Path::new) else { return Ok(()) };
    for entry in fs::read_dir(place).into_iter().flatten().flatten() {
        let folder = entry.path();
        if !entry.file_name().to_str().is_some_and(is_staging_name) || !folder.is_dir() {
            continue;
        }
        let lock = match File::options().read(true).write(true).open(folder.join(LOCK)) {
            Ok(lock) => lock,
            Err(_) if caller == Caller::Writer && is_old(&folder) => {
                // Its process was killed right after making it, or it is not ours and stays: only empty folders go.
                let _ = fs::remove_dir(&folder);
                continue;
            }
            Err(_) => continue,
        };
        if lock.try_lock().is_err() {
            continue;
        }
        match Swap::from_journal(&folder) {
            Some(swap) if swap.contains(name) => {
                let places = Places { staging: &folder, asset: place };
                finish(&swap, places).map_err(|e| Error::io(path, std::io::Error::other(e)))?;
                remove(&folder);
            }
            None if caller == Caller::Writer && !folder.join(super::swap::JOURNAL).exists() => {
                remove(&folder)
            }
            _ => {}
        }
    }
    Ok(())
}

/// Moves the rest of the files of a dead process, or puts all back if that fails.
fn finish(swap: &Swap, places: Places<'_>) -> Result<(), String> {
    let steps = Steps::default();
    let Err(error) = swap.resume(places, &steps) else { return Ok(()) };
    swap.undo(places, &steps).map_err(|lost| {
        let folder = text::path(places.staging);
        format!("writing it was interrupted and can neither be finished ({error}) nor undone ({lost}); see {folder}")
    })
}

/// Whether a name is one that [`temporary_name`] makes: `.NAME.PID-N.tmp`.
fn is_staging_name(name: &str) -> bool {
    let inner = name.strip_prefix('.').and_then(|n| n.strip_suffix(".tmp")).and_then(|n| n.rsplit_once('.'));
    let is_number = |n: &str| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit());
    inner.and_then(|(_, numbers)| numbers.split_once('-')).is_some_and(|(a, b)| is_number(a) && is_number(b))
}

fn is_old(folder: &Path) -> bool {
    let made = fs::metadata(folder).and_then(|m| m.modified());
    made.is_ok_and(|at| at.elapsed().is_ok_and(|age| age > MAKING_TIME))
}
