//! The GLB container: a header of 12 bytes, a chunk of JSON, a chunk of binary data.

use super::JSON_BYTES_MAX;
use crate::{Error, Result};
use std::path::Path;

const MAGIC: [u8; 4] = *b"glTF";
const VERSION: u32 = 2;
const JSON: [u8; 4] = *b"JSON";
const BIN: [u8; 4] = *b"BIN\0";

/// Lengths of the headers of a file and of a chunk.
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// Whether the bytes begin as a `.glb` does; otherwise they may be the JSON of a `.gltf`.
pub fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// Joins JSON and binary data to a `.glb`.
///
/// # Errors
/// [`Error::TooLarge`] beyond 4 GiB, the limit of the container.
pub fn glb(mut json: Vec<u8>, mut bin: Vec<u8>) -> Result<Vec<u8>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let total = HEADER_BYTES + 2 * CHUNK_HEADER_BYTES + json.len() + bin.len();
    let too_large = || too_large!("", "{total} bytes, but a .glb holds at most {}: write a .gltf", u32::MAX);
    let length = u32::try_from(total).map_err(|_| too_large())?;
    let mut head = Vec::with_capacity(total - bin.len());
    head.extend(MAGIC);
    head.extend(VERSION.to_le_bytes());
    head.extend(length.to_le_bytes());
    // Chunks are shorter than the file, whose length fits.
    let chunk_header = |bytes: usize, kind: [u8; 4]| (bytes as u32).to_le_bytes().into_iter().chain(kind);
    head.extend(chunk_header(json.len(), JSON));
    head.extend(json);
    head.extend(chunk_header(bin.len(), BIN));
    // In place, to save a copy of a large file.
    bin.reserve_exact(head.len());
    bin.splice(0..0, head);
    Ok(bin)
}

/// The parts of a file.
pub struct Parts<'a> {
    /// JSON, perhaps padded with spaces.
    pub json: &'a [u8],
    /// Data of buffer 0; `None` in a `.gltf`.
    pub bin: Option<&'a [u8]>,
}

/// Splits a `.glb` into its parts, or takes the bytes of a `.gltf` as JSON.
///
/// # Errors
/// [`Error::Invalid`] if chunks do not fit the file, [`Error::Unsupported`] for other versions, [`Error::TooLarge`].
pub fn parts<'a>(bytes: &'a [u8], path: &Path) -> Result<Parts<'a>> {
    let parts = if is_glb(bytes) { glb_parts(bytes, path)? } else { Parts { json: bytes, bin: None } };
    if parts.json.len() > JSON_BYTES_MAX {
        return Err(too_large!(path, "{} bytes of JSON, at most {JSON_BYTES_MAX}", parts.json.len()));
    }
    Ok(parts)
}

fn glb_parts<'a>(bytes: &'a [u8], path: &Path) -> Result<Parts<'a>> {
    let cut = |what: &str| invalid!(path, "{what}: the file is truncated or damaged");
    let version = u32_at(bytes, 4).ok_or_else(|| cut("no GLB header"))?;
    if version != VERSION {
        return Err(unsupported!(path, "GLB of version {version}, supported: {VERSION}"));
    }
    let length = u32_at(bytes, 8).ok_or_else(|| cut("no GLB header"))? as usize;
    if length != bytes.len() {
        return Err(cut(&format!("GLB header states {length} bytes, the file has {}", bytes.len())));
    }
    let (mut json, mut bin, mut at) = (None, None, HEADER_BYTES);
    while at < bytes.len() {
        let size = u32_at(bytes, at).ok_or_else(|| cut("header of a GLB chunk"))? as usize;
        let first = at + CHUNK_HEADER_BYTES;
        let kind = bytes.get(at + 4..first).ok_or_else(|| cut("header of a GLB chunk"))?;
        let end = first.checked_add(size).filter(|&end| end <= bytes.len());
        let end = end.ok_or_else(|| cut(&format!("GLB chunk of {size} bytes at byte {at}")))?;
        let chunk = &bytes[first..end];
        match () {
            () if json.is_none() && kind == JSON => json = Some(chunk),
            () if json.is_none() => return Err(Error::invalid(path, "the first GLB chunk is not JSON")),
            () if bin.is_none() && kind == BIN => bin = Some(chunk),
            // Further chunks may follow; readers ignore them.
            () => {}
        }
        at = end;
    }
    let json = json.ok_or_else(|| cut("no JSON chunk"))?;
    Ok(Parts { json, bin })
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let b = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(b.try_into().ok()?))
}
