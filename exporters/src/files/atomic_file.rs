//! Writes files that appear whole or not at all: under a temporary name in the same folder, synced to the disk, renamed.

use crate::{Error, Result};
use std::fs::{self, File, Permissions};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Characters of a file's name that its temporary name keeps: most systems allow 255 bytes.
const SHOWN_CHARS: usize = 40;

/// Refuses the place of a file where there is anything but a regular file or a link to one: a device or a pipe would
/// be replaced, and opening a pipe may block.
///
/// # Errors
/// [`Error::Occupied`].
pub fn check_place(path: &Path) -> Result<()> {
    let what = match fs::metadata(path) {
        Ok(facts) if facts.is_dir() => "is a folder, expected the name of a file",
        Ok(facts) if !facts.is_file() => {
            "is a device or a pipe, expected a regular file; choose another name, or remove it"
        }
        // What cannot be looked at is reported when it is written.
        Ok(_) | Err(_) => return Ok(()),
    };
    Err(Error::Occupied { path: path.to_owned(), what: what.to_owned() })
}

/// Writes a file. A link to a file is replaced, not followed. If anything fails, `path` is as before.
///
/// # Errors
/// [`Error::Io`] naming `path`, or as [`check_place`].
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |temporary| fs::write(temporary, bytes).map_err(|e| Error::io(path, e)))
}

/// As [`write()`], but lets `fill` write the file at a temporary place. It gets the permissions of any new file.
///
/// # Errors
/// Those of `fill` and of [`write()`].
pub fn write_with<E: From<Error>>(path: &Path, fill: impl FnOnce(&Path) -> Result<(), E>) -> Result<(), E> {
    check_place(path)?;
    let temporary = temporary_beside(path);
    let io = |e| E::from(Error::io(path, e));
    let outcome = new_file_permissions(&temporary).map_err(io).and_then(|permissions| {
        fill(&temporary)?;
        restore(&temporary, permissions).and_then(|()| move_to(path, &temporary)).map_err(io)
    });
    if outcome.is_err() {
        // The first error is the one to report, not that of removing a leftover.
        let _ = fs::remove_file(&temporary);
    }
    outcome
}

/// Moves a finished file of the same file system to its place, once it is safely on the disk.
///
/// # Errors
/// Those of the system.
pub(crate) fn move_to(path: &Path, finished: &Path) -> std::io::Result<()> {
    File::options().write(true).open(finished)?.sync_all()?;
    fs::rename(finished, path)?;
    // The rename itself must survive a power cut too; not every system lets a folder be opened.
    if let Some(folder) = path.parent()
        && let Ok(folder) = File::open(if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
    {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// A name in the same folder that is unique to this call: `.NAME.PID-N.part`.
pub(crate) fn temporary_beside(path: &Path) -> PathBuf {
    static CALLS: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name: String = name.chars().take(SHOWN_CHARS).collect();
    let (process, call) = (std::process::id(), CALLS.fetch_add(1, Ordering::Relaxed));
    path.with_file_name(format!(".{name}.{process}-{call}.part"))
}

/// The permissions that the system gives to new files. `fill` may replace the file by one with others, as libraries
/// do that write through private temporary files.
fn new_file_permissions(temporary: &Path) -> std::io::Result<Permissions> {
    File::create(temporary)?.metadata().map(|facts| facts.permissions())
}

fn restore(file: &Path, permissions: Permissions) -> std::io::Result<()> {
    if fs::metadata(file)?.permissions() == permissions {
        Ok(())
    } else {
        fs::set_permissions(file, permissions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn written_files_have_default_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (path, plain) = (folder.path().join("a.txt"), folder.path().join("b.txt"));
        write_with(&path, |temporary| {
            // A file of its own that only its owner may read.
            let private = tempfile::NamedTempFile::new_in(folder.path()).unwrap();
            private.persist(temporary).unwrap();
            Ok::<_, Error>(())
        })
        .unwrap();
        fs::write(&plain, "").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode(&path), mode(&plain));
    }

    #[cfg(unix)]
    #[test]
    fn only_regular_files_and_links_to_them_are_replaced() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let made = std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap();
        assert!(made.success());
        symlink(at("pipe"), at("link-to-pipe")).unwrap();
        fs::create_dir(at("folder")).unwrap();
        for (name, what) in [("pipe", "pipe"), ("link-to-pipe", "pipe"), ("folder", "folder")] {
            let error = write(&at(name), b"new").unwrap_err();
            let named = error.to_string().contains(name) && error.to_string().contains(what);
            assert!(matches!(error, Error::Occupied { .. }) && named, "{error}");
        }
        assert!(at("pipe").metadata().unwrap().file_type().is_fifo());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3, "nothing temporary is left");
        // Negative controls: a link to a file, and one to nothing.
        fs::write(at("file"), "old").unwrap();
        for target in ["file", "nothing"] {
            let link = at(&format!("link-to-{target}"));
            symlink(at(target), &link).unwrap();
            write(&link, b"new").unwrap();
            assert_eq!(fs::read(&link).unwrap(), b"new");
        }
    }

    #[test]
    fn the_longest_legal_names_can_be_written() {
        let folder = tempfile::tempdir().unwrap();
        let alike = ["a", "b"].map(|last| folder.path().join("n".repeat(254) + last));
        for path in &alike {
            write(path, b"whole").unwrap();
            assert_eq!(fs::read(path).unwrap(), b"whole");
        }
        assert_ne!(temporary_beside(&alike[0]), temporary_beside(&alike[1]));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn failure_leaves_the_old_file_and_no_leftover() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write(&path, b"old").unwrap();
        let failed: Result<()> = write_with(&path, |temporary| {
            fs::write(temporary, b"half").unwrap();
            Err(Error::invalid(&path, "stop"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        write(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
