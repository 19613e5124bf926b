//! The container of version 4: a header, records of extensions, a table of contents and a zstd stream for each attribute.

use super::container::{Container, Header, Stream};
use super::extensions::{Extensions, META_RECORD};
use super::{NAMES, NUM_STREAMS};
use crate::files::limits::with_room;
use crate::{Error, ReadLimits, Result};
use std::path::Path;

/// The common header, the place of the table of contents, and reserved bytes.
const HEADER_BYTES: usize = 32;
/// An entry of the table of contents: the sizes of a stream, compressed and not.
const TOC_ENTRY_BYTES: usize = 16;
/// Slow to write: files are written once and read often.
const ZSTD_LEVEL: i32 = 19;

/// Packs the common header, whose last byte is replaced by the number of streams, the streams and our metadata. A stream
/// without bytes has no entry.
///
/// # Errors
/// [`Error::Invalid`] with what zstd reports.
pub fn pack(header: &[u8], streams: &[Vec<u8>], meta: &[u8]) -> Result<Vec<u8>> {
    let streams: Vec<&Vec<u8>> = streams.iter().filter(|stream| !stream.is_empty()).collect();
    let mut bytes = header[..15].to_vec();
    bytes.push(streams.len() as u8);
    bytes.extend(((HEADER_BYTES + 8 + meta.len()) as u32).to_le_bytes());
    bytes.resize(HEADER_BYTES, 0);
    bytes.extend(META_RECORD.to_le_bytes());
    bytes.extend((meta.len() as u32).to_le_bytes());
    bytes.extend(meta);
    let compress = |stream: &&Vec<u8>| zstd::bulk::compress(stream, ZSTD_LEVEL);
    let compressed: std::io::Result<Vec<Vec<u8>>> = streams.iter().map(compress).collect();
    let compressed = compressed.map_err(|e| invalid!("", "zstd: {e}"))?;
    for (stream, packed) in streams.iter().zip(&compressed) {
        bytes.extend((packed.len() as u64).to_le_bytes());
        bytes.extend((stream.len() as u64).to_le_bytes());
    }
    bytes.extend(compressed.concat());
    Ok(bytes)
}

/// Decompresses a file.
///
/// # Errors
/// As [`super::decode_spz`].
pub fn unpack(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Container> {
    let header = Header::parse(bytes, path)?;
    if header.version < 4 {
        return Err(unsupported!(path, "SPZ version {} that is not within gzip", header.version));
    }
    let toc = word(bytes, 16).filter(|_| bytes.len() >= HEADER_BYTES);
    let toc = toc.ok_or_else(|| invalid!(path, "{} bytes, the header of an SPZ file has 32", bytes.len()))?
        as usize;
    let expected = NUM_STREAMS - usize::from(header.stored_sh_degree == 0);
    if usize::from(header.last) < expected {
        return Err(invalid!(path, "{} streams, expected {expected}", header.last));
    }
    let sizes = header.sizes(bytes.len(), path, limits)?;
    let mut at = toc.saturating_add(usize::from(header.last) * TOC_ENTRY_BYTES);
    let mut streams = Vec::new();
    // Files without SH may have an empty sixth stream.
    for (i, (&expected, name)) in sizes.iter().zip(NAMES).enumerate().take(expected) {
        let offence = |what: String| invalid!(path, "stream {name:?}: {what}");
        let entry = toc.saturating_add(i * TOC_ENTRY_BYTES);
        let entry = bytes.get(entry..entry.saturating_add(TOC_ENTRY_BYTES));
        let entry = entry.ok_or_else(|| offence("its sizes lie beyond the end of the file".to_owned()))?;
        let [packed, raw] = [0, 8].map(|o| entry[o..].first_chunk().map_or(0, |b| u64::from_le_bytes(*b)));
        if raw != expected as u64 {
            let what = format!("{raw} bytes, expected {expected} for {} splats", header.num_splats);
            return Err(offence(what));
        }
        let end = usize::try_from(packed).ok().and_then(|p| at.checked_add(p));
        let data = end.and_then(|end| bytes.get(at..end));
        let data =
            data.ok_or_else(|| offence(format!("{packed} bytes at {at} of a file of {}", bytes.len())))?;
        at += data.len();
        streams.push(Stream { data: decompressed(data, expected, &offence)?, packed_bytes: packed });
    }
    let records = bytes.get(HEADER_BYTES..toc.min(bytes.len())).unwrap_or_default();
    Ok(Container { streams, extensions: Extensions::parse(records, header.flags), header })
}

fn decompressed(data: &[u8], expected: usize, offence: &dyn Fn(String) -> Error) -> Result<Vec<u8>> {
    let failed = |e: std::io::Error| offence(format!("zstd: {e}"));
    let mut raw: Vec<u8> = with_room(expected)?;
    let mut decompressor = zstd::bulk::Decompressor::new().map_err(failed)?;
    decompressor.decompress_to_buffer(data, &mut raw).map_err(failed)?;
    if raw.len() != expected {
        return Err(offence(format!("{} bytes, expected {expected}", raw.len())));
    }
    Ok(raw)
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.first_chunk().map(|b| u32::from_le_bytes(*b))
}
