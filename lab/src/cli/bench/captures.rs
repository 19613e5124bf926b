//! The captures of a benchmark that `litetex sample` makes: each once, in a folder named after the scene and what it is
//! made with.

use super::folder::{CAPTURES, plain, remove_folder};
use crate::cli::litetex::output;
use litetex_gs::console::Log;
use litetex_gs::{Error, Result};
use litetex_lab::matrix::Cell;
use std::fs;
use std::path::Path;

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
        let part = cell.path.with_added_extension("part");
        remove_folder(&part)?;
        let folder = part.display().to_string();
        let words = [&["sample".to_owned(), folder, "--quiet".to_owned()], &*cell.sample].concat();
        output(program, &words).map_err(|e| Error::Usage(format!("litetex sample: {e}")))?;
        fs::rename(&part, &cell.path).map_err(|e| Error::io(&cell.path, e))?;
    }
    Ok(())
}

fn folder_name(cell: &Cell) -> String {
    let made_with = format!("{}\n{}", env!("CARGO_PKG_VERSION"), cell.sample.join("\n"));
    format!("{}-{:08x}", plain(&cell.scene, 40), crc32fast::hash(made_with.as_bytes()))
}
