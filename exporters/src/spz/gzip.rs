//! The container of versions 1 to 3: header and streams one after the other in a single gzip stream.

use super::NAMES;
use super::container::{Container, HEADER_BYTES, Header, Stream};
use super::extensions::{Extensions, HAS_EXTENSIONS};
use crate::files::limits::filled;
use crate::{Error, ReadLimits, Result};
use flate2::bufread::GzDecoder;
use flate2::{Compression, GzBuilder};
use std::io::{Read, Write};
use std::path::Path;

/// The first bytes of gzip with deflate.
pub const MAGIC: [u8; 2] = [0x1f, 0x8b];
/// Name of our subfield of the extra field of RFC 1952.
const SUBFIELD: [u8; 2] = *b"LT";
/// Most bytes of a subfield: the field with its name and length has 65,535 at most.
const SUBFIELD_BYTES_MAX: usize = 65_531;

/// Packs the header, the streams and our metadata.
///
/// # Errors
/// [`Error::TooLarge`] if the metadata have more than 65,531 bytes.
pub fn pack(header: &[u8], streams: &[Vec<u8>], meta: &[u8]) -> Result<Vec<u8>> {
    if meta.len() > SUBFIELD_BYTES_MAX {
        let what = format!(
            "{} bytes of metadata, SPZ version 3 has room for {SUBFIELD_BYTES_MAX}: leave the cameras out, or write version 4",
            meta.len()
        );
        return Err(Error::too_large("", what));
    }
    let length = (meta.len() as u16).to_le_bytes();
    let extra = [&SUBFIELD, &length, meta].concat();
    let failed = |e: std::io::Error| invalid!("", "gzip: {e}");
    let mut encoder = GzBuilder::new().extra(extra).write(Vec::new(), Compression::best());
    std::iter::once(header)
        .chain(streams.iter().map(Vec::as_slice))
        .try_for_each(|part| encoder.write_all(part))
        .map_err(failed)?;
    encoder.finish().map_err(failed)
}

/// Most bytes of the records of extensions behind the streams: ours are not among them, and others are of some bytes.
const RECORDS_BYTES_MAX: u64 = 1 << 20;

/// Decompresses a file. What follows the streams is read only if it is announced: some programs add levels of detail there.
///
/// # Errors
/// As [`super::decode_spz`].
pub fn unpack(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Container> {
    let mut decoder = GzDecoder::new(bytes);
    let mut head = [0; HEADER_BYTES];
    decoder.read_exact(&mut head).map_err(|e| invalid!(path, "header: gzip: {e}"))?;
    let header = Header::parse(&head, path)?;
    if header.version > 3 {
        return Err(invalid!(path, "SPZ version {} within gzip, expected 1 to 3", header.version));
    }
    let sizes = header.sizes(bytes.len(), path, limits)?;
    let mut streams = Vec::new();
    for (name, size) in NAMES.iter().zip(sizes) {
        let mut data = filled(size, 0).map_err(|e| e.at(path))?;
        let before = decoder.get_ref().len();
        decoder.read_exact(&mut data).map_err(|e| invalid!(path, "stream {name:?}: gzip: {e}"))?;
        streams.push(Stream { data, packed_bytes: (before - decoder.get_ref().len()) as u64 });
    }
    let mut records = Vec::new();
    if header.flags & HAS_EXTENSIONS != 0 {
        let mut first = decoder.by_ref().take(RECORDS_BYTES_MAX);
        first.read_to_end(&mut records).map_err(|e| invalid!(path, "extension records: gzip: {e}"))?;
    }
    // The end of the stream has the checksum of all.
    let mut rest = decoder.by_ref().take(limits.decoded_bytes);
    std::io::copy(&mut rest, &mut std::io::sink()).map_err(|e| invalid!(path, "gzip: {e}"))?;
    let meta = decoder.header().and_then(flate2::GzHeader::extra).and_then(subfield).map(<[u8]>::to_vec);
    let extensions = Extensions { meta, ..Extensions::parse(&records, header.flags) };
    Ok(Container { header, streams, extensions })
}

/// Our subfield of an extra field.
fn subfield(mut extra: &[u8]) -> Option<&[u8]> {
    loop {
        let (&[a, b, low, high], rest) = extra.split_first_chunk()?;
        let (value, rest) = rest.split_at_checked(usize::from(u16::from_le_bytes([low, high])))?;
        if [a, b] == SUBFIELD {
            return Some(value);
        }
        extra = rest;
    }
}
