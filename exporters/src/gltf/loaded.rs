//! A file whose JSON has been parsed and whose buffers have been read. Every look-up is bounds-checked, and decoded bytes
//! count towards the limit.

use super::accessor::View;
use super::container::{self, Parts};
use super::document::{Accessor, BufferView, Document};
use super::{EXTENSION, KHR, QUANTIZATION, UNLIT, files, scene};
use crate::files::read::read_file;
use crate::files::sidecars::SidecarHashes;
use crate::{Error, ReadLimits, Result, quoted};
use serde::Deserialize as _;
use std::borrow::Cow;
use std::cell::Cell;
use std::path::Path;

/// Most buffers that a file may have.
const BUFFERS_MAX: usize = 1024;

/// Most objects in the JSON of a file.
const JSON_OBJECTS_MAX: usize = 1 << 17;

/// Most commas and lists in the JSON of a file.
const JSON_VALUES_MAX: usize = 1 << 21;

/// Extensions that a file may require.
const UNDERSTOOD: [&str; 4] = [KHR, EXTENSION, QUANTIZATION, UNLIT];

/// Whether sidecar files may be read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum SidecarFiles {
    /// Those in the folder of the file.
    Read,
    /// No sidecar files: only the bytes of the file are known.
    Refuse,
}

/// A parsed file with its buffers.
pub struct Loaded<'a> {
    pub document: Document,
    /// For messages and for finding sidecar files.
    pub path: &'a Path,
    /// Bytes of all files that have been read.
    pub num_bytes: Cell<u64>,
    buffers: Vec<Cow<'a, [u8]>>,
    sidecar_files: SidecarFiles,
    hashes: SidecarHashes,
    pub limits: ReadLimits,
    /// Bytes that have been counted against the limits.
    taken_bytes: Cell<u64>,
}

impl<'a> Loaded<'a> {
    /// Parses the bytes of a `.glb` or `.gltf` and reads its buffers.
    ///
    /// # Errors
    /// [`Error::Invalid`], [`Error::Unsupported`], [`Error::TooLarge`] as [`super::read_gltf`].
    pub fn new(
        bytes: &'a [u8],
        path: &'a Path,
        limits: &ReadLimits,
        sidecar_files: SidecarFiles,
    ) -> Result<Self> {
        let parts = container::parts(bytes, path)?;
        check_json(parts.json, path)?;
        let document: Document =
            serde_json::from_slice(parts.json).map_err(|e| invalid!(path, "JSON of the file: {e}"))?;
        check_versions(&document, path)?;
        // Checked in full when the extension is parsed.
        let hashes = scene::splat_primitives(&document)
            .find_map(|found| SidecarHashes::deserialize(found.splatting.texture()?.get("sidecars")?).ok());
        let mut loaded = Self {
            hashes: hashes.unwrap_or_default(),
            document,
            path,
            num_bytes: Cell::new(bytes.len() as u64),
            buffers: Vec::new(),
            sidecar_files,
            limits: *limits,
            taken_bytes: Cell::new(0),
        };
        loaded.load_buffers(&parts)?;
        Ok(loaded)
    }

    fn load_buffers(&mut self, parts: &Parts<'a>) -> Result<()> {
        let count = self.document.buffers.len();
        if count > BUFFERS_MAX {
            return Err(too_large!(self.path, "{count} buffers, at most {BUFFERS_MAX}"));
        }
        for i in 0..count {
            let buffer = &self.document.buffers[i];
            let needed = buffer.byte_length;
            let bytes: Cow<'a, [u8]> = match (&buffer.uri, parts.bin) {
                (Some(uri), _) => Cow::Owned(self.side_file(uri)?),
                (None, Some(bin)) if i == 0 => Cow::Borrowed(bin),
                (None, _) => Cow::Borrowed(&[]),
            };
            if (bytes.len() as u64) < needed {
                let file =
                    buffer.uri.as_deref().map_or(String::new(), |uri| format!(" in file {}", quoted(uri)));
                let found = bytes.len();
                let what =
                    format!("buffer {i}: {needed} bytes declared, {found} found{file}: data are missing");
                return Err(Error::invalid(self.path, what));
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// Counts bytes that are about to be allocated.
    ///
    /// # Errors
    /// [`Error::TooLarge`] beyond the limit.
    pub fn take_bytes(&self, bytes: u64, what: &str) -> Result<()> {
        let taken = self.taken_bytes.get();
        let left = self.limits.of_file(self.num_bytes.get()).decoded_bytes.saturating_sub(taken);
        if bytes > left {
            return Err(too_large!(self.path, "{what}: {bytes} bytes to decode, the limit leaves {left}"));
        }
        self.taken_bytes.set(taken + bytes);
        Ok(())
    }

    /// Reads a sidecar file.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if they may not be read, [`Error::Invalid`] for a file of another export, and those of
    /// [`files::resolve`] and [`read_file`], naming both files.
    pub fn side_file(&self, uri: &str) -> Result<Vec<u8>> {
        if self.sidecar_files == SidecarFiles::Refuse {
            let shown = quoted(uri);
            let what = format!("the sidecar file {shown} is needed: open the file by its path");
            return Err(Error::unsupported(self.path, what));
        }
        let left = self.limits.decoded_bytes.saturating_sub(self.taken_bytes.get());
        let file = files::resolve(uri, self.path);
        let bytes = file.and_then(|file| read_file(&file, left)).map_err(|e| e.named_by(self.path))?;
        self.num_bytes.set(self.num_bytes.get() + bytes.len() as u64);
        self.take_bytes(bytes.len() as u64, "sidecar files")?;
        self.hashes.check(uri, &bytes, self.path)?;
        Ok(bytes)
    }

    /// Size of a sidecar file; 0 if it cannot be found.
    pub fn side_file_bytes(&self, uri: &str) -> u64 {
        let allowed = self.sidecar_files == SidecarFiles::Read;
        let file = allowed.then(|| files::resolve(uri, self.path).ok()).flatten();
        file.and_then(|f| f.metadata().ok()).map_or(0, |facts| facts.len())
    }

    /// A buffer view and its bytes; `what` names it in messages.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it does not lie in its buffer.
    pub fn view(&self, index: u32, what: &str) -> Result<(&BufferView, &[u8])> {
        let offence = |text: String| invalid!(self.path, "{what}: {text}");
        let views = &self.document.buffer_views;
        let view = views.get(index as usize);
        let view = view.ok_or_else(|| offence(format!("bufferView {index} of {}", views.len())))?;
        let buffer = self.buffers.get(view.buffer as usize);
        let buffer =
            buffer.ok_or_else(|| offence(format!("bufferView {index}: no buffer {}", view.buffer)))?;
        let declared = self.document.buffers[view.buffer as usize].byte_length;
        let end = view.byte_offset.checked_add(view.byte_length).filter(|&end| end <= declared);
        let end = end.ok_or_else(|| {
            let BufferView { byte_offset, byte_length, .. } = view;
            offence(format!(
                "bufferView {index}: {byte_length} bytes from byte {byte_offset} of a buffer of {declared}"
            ))
        })?;
        // The buffer is as long as declared, so these fit usize.
        Ok((view, &buffer[view.byte_offset as usize..end as usize]))
    }

    /// The data of an accessor; `what` names it in messages.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it does not lie in its view, [`Error::Unsupported`] for sparse ones.
    pub fn accessor(&self, index: u32, what: &str) -> Result<View<'_>> {
        let accessors = &self.document.accessors;
        let accessor: &Accessor = accessors
            .get(index as usize)
            .ok_or_else(|| invalid!(self.path, "{what}: accessor {index} of {}", accessors.len()))?;
        let Some(view) = accessor.buffer_view.filter(|_| accessor.sparse.is_none()) else {
            let text = format!("{what}: accessor {index} is sparse or without bufferView; store it in full");
            return Err(Error::unsupported(self.path, text));
        };
        let (view, bytes) = self.view(view, what)?;
        View::new(accessor, view, bytes)
            .map_err(|text| invalid!(self.path, "{what}: accessor {index}: {text}"))
    }
}

/// Bounds the memory of parsed JSON: an empty node is two characters, but 300 bytes in memory. Our largest metadata has a
/// tenth of each bound.
fn check_json(json: &[u8], path: &Path) -> Result<()> {
    let (mut objects, mut values) = (0_usize, 0_usize);
    for byte in json {
        objects += usize::from(*byte == b'{');
        values += usize::from(matches!(byte, b',' | b'['));
    }
    if objects > JSON_OBJECTS_MAX || values > JSON_VALUES_MAX {
        let what = format!(
            "JSON of {objects} objects and {values} values, at most {JSON_OBJECTS_MAX} and {JSON_VALUES_MAX}"
        );
        return Err(Error::too_large(path, what));
    }
    Ok(())
}

fn check_versions(document: &Document, path: &Path) -> Result<()> {
    let info = &document.asset;
    let wanted = info.min_version.as_ref().unwrap_or(&info.version);
    if !(wanted == "2.0" || info.min_version.is_none() && wanted.starts_with("2.")) {
        let shown = quoted(wanted);
        return Err(unsupported!(path, "glTF of version {shown}, supported: \"2.0\""));
    }
    match document.extensions_required.iter().find(|e| !UNDERSTOOD.contains(&e.as_str())) {
        Some(name) => {
            let name = quoted(name);
            Err(unsupported!(path, "the file requires the extension {name}, supported: {UNDERSTOOD:?}"))
        }
        None => Ok(()),
    }
}
