//! The captures of a benchmark that `litetex sample` makes: each once, in a folder named after the scene and what it is
//! made with.

use crate::cli::litetex::output;
use litetex_gs::console::Log;
use litetex_gs::{Error, Result};
use litetex_lab::matrix::Cell;
use std::fs;
use std::path::{Path, PathBuf};

/// Folder of the captures in the folder of the benchmark.
pub const CAPTURES: &str = "captures";

/// Gives the cells the paths of their captures.
pub fn place(cells: &mut [Cell], out: &Path) {
    for cell in cells.iter_mut().filter(|c| !c.sample.is_empty()) {
        cell.path = out.join(CAPTURES).join(folder_name(cell));
    }
}

/// Makes the captures that are missing.
///
/// # Errors
/// [`Error::Io`], [`Error::Usage`] with the message of `litetex sample`.
pub fn make(cells: &[&Cell], program: &Path, log: &Log) -> Result<()> {
    for cell in cells.iter().filter(|c| !c.sample.is_empty()) {
        if cell.path.exists() {
            continue;
        }
        log.info(&format!("making the capture {:?}", cell.scene));
        // A capture has its name only once it is complete.
        let part = part_of(&cell.path);
        remove(&part)?;
        let folder = part.display().to_string();
        let words = [&["sample".to_owned(), folder, "--quiet".to_owned()], &*cell.sample].concat();
        output(program, &words).map_err(|e| Error::Usage(format!("litetex sample: {e}")))?;
        fs::rename(&part, &cell.path).map_err(|e| Error::io(&cell.path, e))?;
    }
    Ok(())
}

/// Removes captures, and nothing else that may be among them.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_all(folder: &Path) -> Result<()> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for entry in entries {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        if path.file_name().and_then(|n| n.to_str()).is_some_and(is_name_of_capture) {
            remove(&path)?;
        }
    }
    Ok(())
}

fn part_of(path: &Path) -> PathBuf {
    path.with_added_extension("part")
}

fn remove(folder: &Path) -> Result<()> {
    if folder.is_dir() { fs::remove_dir_all(folder).map_err(|e| Error::io(folder, e)) } else { Ok(()) }
}

fn folder_name(cell: &Cell) -> String {
    let safe = cell.scene.chars().map(|c| if c.is_alphanumeric() || "-_+".contains(c) { c } else { '_' });
    let made_with = format!("{}\n{}", env!("CARGO_PKG_VERSION"), cell.sample.join("\n"));
    format!("{}-{:08x}", safe.take(40).collect::<String>(), crc32fast::hash(made_with.as_bytes()))
}

/// Whether a name ends like those of [`folder_name`].
fn is_name_of_capture(name: &str) -> bool {
    let hash = name.trim_end_matches(".part").rsplit('-').next().unwrap_or_default();
    hash.len() == 8 && hash.len() < name.len() && hash.bytes().all(|b| b.is_ascii_hexdigit())
}
