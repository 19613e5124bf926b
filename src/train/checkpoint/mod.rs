//! Checkpoints: a [`TrainState`] as one safetensors file, bit for bit and written atomically.
//!
//! Layout (`litetex-checkpoint/16`): one little-endian tensor per array, see `layout.rs`. The only
//! metadata entry, `litetex`, is a JSON object with the format, the program's version and strings that belong to
//! the caller; a single entry, because the order of several would differ from file to file. The tensor
//! `checksum` is the CRC-32 of everything else, so that a damaged file is refused.
//!
//! Times and evaluations are in a JSON file next to it (`step-000300.history.json`), so that equal
//! states are equal files. Without it a run continues all the same, with its clock at zero.

mod header;
mod layout;
mod reader;
mod rounded;
mod tensor;
#[cfg(test)]
mod tests;

pub use self::header::FORMAT;
use self::header::{CHECKSUM, Checksum, Header, METADATA_KEY};
use crate::train::{TrainHistory, TrainState};
use crate::{Error, Result, atomic_file, input_file};
use safetensors::SafeTensorError;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// Largest history that is read; it has a few numbers per evaluation.
const HISTORY_BYTES_MAX: u64 = 1 << 30;

/// Writes `history`, then the state without its own history. `strings` are the caller's: configuration, views,
/// whatever is needed to repeat the run.
///
/// # Errors
/// [`Error::Io`] naming the file; no partial file is left behind.
pub fn save(
    path: &Path,
    state: &TrainState,
    history: &TrainHistory,
    strings: &BTreeMap<String, String>,
) -> Result<()> {
    let history = serde_json::to_string(history).map_err(|e| Error::io(path, e.into()))?;
    atomic_file::write(&history_path(path), history.as_bytes())?;
    let header = Header {
        format: FORMAT.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        strings: strings.clone(),
    };
    let header = serde_json::to_string(&header).map_err(|e| Error::io(path, e.into()))?;
    let mut tensors = layout::tensors(state);
    let mut crc = Checksum::new(&header);
    for (name, tensor) in &tensors {
        crc.add(name, tensor.dtype(), &tensor.shape, &tensor.bytes());
    }
    tensors.insert(CHECKSUM.to_owned(), tensor::Tensor::scalar_u32(crc.finish()));
    let metadata = HashMap::from([(METADATA_KEY.to_owned(), header)]);
    atomic_file::write_with(path, |temporary| {
        safetensors::serialize_to_file(&tensors, Some(metadata), temporary).map_err(|e| match e {
            SafeTensorError::IoError(e) => Error::io(path, e),
            other => Error::io(path, std::io::Error::other(other.to_string())),
        })
    })
}

/// Reads a state and the caller's strings.
///
/// # Errors
/// [`Error::Io`], [`Error::InvalidInput`] naming the tensor, what was found and what was expected, or
/// [`Error::Unsupported`] for a layout of another version.
pub fn load(path: &Path) -> Result<(TrainState, BTreeMap<String, String>)> {
    let (mut state, strings) = load_without_history(path)?;
    state.history = load_history(&history_path(path))?;
    Ok((state, strings))
}

/// [`load`] without the history, which is left empty; its file may be missing or damaged.
///
/// # Errors
/// As [`load`], except for the history.
pub fn load_without_history(path: &Path) -> Result<(TrainState, BTreeMap<String, String>)> {
    // The size of a model has no bound but the memory.
    let bytes = input_file::read(path, u64::MAX)?;
    load_bytes(path, &bytes)
}

/// The file with a checkpoint's times and evaluations.
pub fn history_path(checkpoint: &Path) -> PathBuf {
    checkpoint.with_extension("history.json")
}

fn load_history(path: &Path) -> Result<TrainHistory> {
    match input_file::read(path, HISTORY_BYTES_MAX) {
        Ok(bytes) => serde_json::from_slice(&bytes).map_err(|e| {
            Error::invalid(path, format!("not the history of a run: {e}; delete it to continue without"))
        }),
        Err(Error::Io { cause, .. }) if cause.kind() == std::io::ErrorKind::NotFound => {
            Ok(TrainHistory::default())
        }
        Err(e) => Err(e),
    }
}

/// [`load_without_history`] from memory; `path` only names the file in errors.
///
/// # Errors
/// As [`load`].
pub fn load_bytes(path: &Path, bytes: &[u8]) -> Result<(TrainState, BTreeMap<String, String>)> {
    let mut reader = reader::Reader::open(path, bytes)?;
    let state = layout::state(&mut reader)?;
    let strings = reader.finish()?;
    reader::check_values(path, &state)?;
    Ok((state, strings))
}
