//! Reads SPZ version 4 by any program; skips the extension records of others.

use super::{
    HAS_EXTENSIONS, HEADER_BYTES, MAGIC, META_RECORD, NUM_STREAMS, TOC_ENTRY_BYTES, VERSION, rotation,
};
use crate::file::read_file;
use crate::limits::{room_for_splats, splat_bytes, with_room};
use crate::meta::Meta;
use crate::yup;
use crate::{
    AssetMap, Contents, Describes, Error, ReadLimits, Result, SPLATS_MAX, Section, SplatAsset, ellipsoid,
    num_sh_coefficients, text,
};
use std::path::Path;

/// Names of the streams in reports.
const NAMES: [&str; NUM_STREAMS] = ["positions", "opacities", "sh0", "scales", "rotations", "sh_rest"];
/// All streams together hold at most this many times the file's bytes. Scenes reach 4 to 8. SH of zeros takes no room, but
/// the nine bytes of a centre among a splat's 65 hardly compress. Ten times that.
const EXPANSION_MAX: u64 = 80;

/// Files of few splats that are alike may exceed [`EXPANSION_MAX`].
const SMALL_BYTES: u64 = 16 << 20;

/// Reads a file. See [`decode_spz`].
///
/// # Errors
/// As [`decode_spz`], and [`Error::Io`].
pub fn read_spz(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    decode_spz(&read_file(path, limits.decoded_bytes)?, path, limits)
}

struct Header {
    num_splats: usize,
    sh_degree: u32,
    fractional_bits: u32,
    toc_offset: usize,
    has_extensions: bool,
}

/// Decodes the bytes of a file; `path` is only for messages. The asset is in the file's frame turned to y down. In our own
/// files that is the capture's frame, and near plane, cameras, background and provenance are those of the original asset,
/// the former two converted to that frame.
///
/// # Errors
/// [`Error::Invalid`] if the file is damaged or not an SPZ file, [`Error::Unsupported`] for other versions,
/// [`Error::TooLarge`].
pub fn decode_spz(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let header = header(bytes, path)?;
    let streams = streams(bytes, &header, path, limits)?;
    let mut sections: Vec<Section> = Vec::new();
    for (name, stream) in NAMES.iter().zip(&streams) {
        let bytes = stream.packed_bytes;
        sections.push(Section { name: (*name).to_owned(), bytes, describes: Describes::Splats });
    }
    let rest = bytes.len() as u64 - sections.iter().map(|s| s.bytes).sum::<u64>();
    sections.push(Section { name: "metadata".to_owned(), bytes: rest, describes: Describes::Other });
    let (mut asset, thick) = splats(&header, &streams, path)?;
    let mut warnings = Vec::new();
    if thick > 0 {
        warnings.push(format!("{thick} splats are thick: drawn as discs, they lose their thinnest axis"));
    }
    let meta = own_meta(bytes, &header);
    if let Some(Err(what)) = &meta {
        warnings.push(text::message(format!("the metadata of this program are damaged: {what}")));
    }
    if let Some(Ok(meta)) = meta {
        // Splats are in the world frame; cameras are converted to it.
        let world_from_local = meta.world_from_capture.after(&meta.capture_from_local);
        asset.world_from_capture = meta.world_from_capture;
        asset.capture_from_local = meta.world_from_capture.inverse();
        asset.near = (f64::from(meta.near) * world_from_local.scale) as f32;
        asset.cameras = meta.cameras.iter().map(|camera| camera.in_frame(&world_from_local)).collect();
        (asset.provenance, asset.background) = (meta.provenance, meta.background);
        (asset.colour_space, asset.filter) = (meta.colour_space, meta.filter);
    }
    asset.validate().map_err(|e| e.at(path))?;
    Ok(Contents {
        asset,
        format: "SPZ 4".to_owned(),
        quality: None,
        hash: None,
        sections,
        layers: Vec::new(),
        warnings,
    })
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.first_chunk().map(|b| u32::from_le_bytes(*b))
}

fn header(bytes: &[u8], path: &Path) -> Result<Header> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let what = "SPZ of version 1 to 3 (gzip); supported: version 4; convert it with a current program";
        return Err(Error::unsupported(path, what));
    }
    let cut = || Error::invalid(path, format!("{} bytes, the header of an SPZ file has 32", bytes.len()));
    if bytes.len() < HEADER_BYTES {
        return Err(cut());
    }
    let words: Option<Vec<u32>> = [0, 4, 8, 16].iter().map(|&at| word(bytes, at)).collect();
    let [magic, version, count, toc] = words.ok_or_else(cut)?[..] else { return Err(cut()) };
    if magic != MAGIC {
        return Err(Error::invalid(
            path,
            format!("begins with {:02x?}, expected \"NGSP\": not an SPZ file", &bytes[..4]),
        ));
    }
    if version != VERSION {
        return Err(Error::unsupported(path, format!("SPZ version {version}; supported: {VERSION}")));
    }
    let [sh_degree, fractional_bits, flags, num_streams] = [12, 13, 14, 15].map(|at| bytes[at]);
    if sh_degree > 3 {
        return Err(Error::unsupported(path, format!("SH degree {sh_degree}; supported: 0 to 3")));
    }
    if fractional_bits > 30 || usize::from(num_streams) < NUM_STREAMS - usize::from(sh_degree == 0) {
        let what = format!(
            "{fractional_bits} fractional bits and {num_streams} streams, expected at most 30 and {NUM_STREAMS}"
        );
        return Err(Error::invalid(path, what));
    }
    let num_splats = count as usize;
    if num_splats > SPLATS_MAX {
        return Err(Error::too_large(path, format!("{num_splats} splats, at most {SPLATS_MAX}")));
    }
    Ok(Header {
        num_splats,
        sh_degree: sh_degree.into(),
        fractional_bits: fractional_bits.into(),
        toc_offset: toc as usize,
        has_extensions: flags & HAS_EXTENSIONS != 0,
    })
}

struct Stream {
    data: Vec<u8>,
    packed_bytes: u64,
}

fn streams(bytes: &[u8], header: &Header, path: &Path, limits: &ReadLimits) -> Result<Vec<Stream>> {
    let n = header.num_splats;
    let sh_bytes = 3 * (num_sh_coefficients(header.sh_degree) - 1);
    let sizes = [9, 1, 3, 3, 4, sh_bytes].map(|width| width * n);
    let total: u64 = sizes.iter().map(|&s| s as u64).sum();
    let decoded = total + splat_bytes(header.sh_degree) * n as u64;
    limits.check(decoded, &format!("{n} splats"), path)?;
    let entries = entries(bytes, header, &sizes, path)?;
    let most = EXPANSION_MAX.saturating_mul(bytes.len() as u64).max(SMALL_BYTES);
    if total > most {
        let what = format!("{total} bytes of splats in a file of {}, at most {most}", bytes.len());
        return Err(Error::too_large(path, what));
    }
    let mut out = Vec::new();
    for (name, (data, &expected)) in NAMES.iter().zip(entries.into_iter().zip(&sizes)) {
        let offence = |what: String| Error::invalid(path, format!("stream {name:?}: {what}"));
        let failed = |e: std::io::Error| offence(format!("zstd: {e}"));
        let mut raw: Vec<u8> = with_room(expected).map_err(|e| e.at(path))?;
        let mut decompressor = zstd::bulk::Decompressor::new().map_err(failed)?;
        decompressor.decompress_to_buffer(data, &mut raw).map_err(failed)?;
        if raw.len() != expected {
            return Err(offence(format!("{} bytes, expected {expected}", raw.len())));
        }
        out.push(Stream { data: raw, packed_bytes: data.len() as u64 });
    }
    Ok(out)
}

/// Compressed bytes of the streams, after checking that the table of contents agrees with the expected sizes.
fn entries<'a>(bytes: &'a [u8], header: &Header, sizes: &[usize], path: &Path) -> Result<Vec<&'a [u8]>> {
    // Files without SH may have an empty sixth stream.
    let count = if header.sh_degree == 0 { NUM_STREAMS - 1 } else { NUM_STREAMS };
    let declared = bytes.get(15).map_or(0, |&b| usize::from(b));
    let mut at = header.toc_offset.saturating_add(declared.saturating_mul(TOC_ENTRY_BYTES));
    let mut out = Vec::new();
    for (i, (&expected, name)) in sizes.iter().zip(NAMES).enumerate().take(count) {
        let offence = |what: String| Error::invalid(path, format!("stream {name:?}: {what}"));
        let entry = header.toc_offset.saturating_add(i * TOC_ENTRY_BYTES);
        let entry = bytes.get(entry..entry.saturating_add(TOC_ENTRY_BYTES));
        let entry = entry.ok_or_else(|| offence("its sizes lie beyond the end of the file".to_owned()))?;
        let [packed, raw] = [0, 8].map(|o| entry[o..].first_chunk().map_or(0, |b| u64::from_le_bytes(*b)));
        if raw != expected as u64 {
            return Err(offence(format!(
                "{raw} bytes, expected {expected} for {} splats",
                header.num_splats
            )));
        }
        let end = usize::try_from(packed).ok().and_then(|p| at.checked_add(p));
        let data = end.and_then(|end| bytes.get(at..end));
        out.push(
            data.ok_or_else(|| offence(format!("{packed} bytes at {at} of a file of {}", bytes.len())))?,
        );
        at += packed as usize;
    }
    Ok(out)
}

fn splats(header: &Header, streams: &[Stream], path: &Path) -> Result<(SplatAsset, usize)> {
    let n = header.num_splats;
    let mut asset = room_for_splats(n, header.sh_degree).map_err(|e| e.at(path))?;
    let step = 1.0 / f64::from(1_u32 << header.fractional_bits);
    let data = |i: usize| streams.get(i).map_or(&[][..], |s| &s.data);
    let mut thick = 0;
    let sh_width = 3 * (num_sh_coefficients(header.sh_degree) - 1);
    for i in 0..n {
        let row = |stream: usize, width: usize| &data(stream)[i * width..(i + 1) * width];
        let fixed = |b: &[u8]| i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8;
        let p = row(0, 9);
        let position = [&p[..3], &p[3..6], &p[6..]].map(|b| (f64::from(fixed(b)) * step) as f32);
        asset.positions.push(yup::position(position));
        asset.opacities.push((f32::from(row(1, 1)[0]) / 255.0).max(f32::MIN_POSITIVE));
        let code = row(4, 4).first_chunk().map_or(0, |b| u32::from_le_bytes(*b));
        let [x, y, z, w] = rotation::decode(code);
        let s = row(3, 3);
        let scales = [s[0], s[1], s[2]].map(|c| (f64::from(c) / 16.0 - 10.0).exp());
        let (q, scales) = ellipsoid::thinnest_last([w, x, y, z], scales);
        thick += usize::from(ellipsoid::is_thick(scales));
        asset.rotations.push(yup::rotation_back(q.map(|v| v as f32)));
        asset.scales.push([scales[0] as f32, scales[1] as f32]);
        let dc = row(2, 3).iter().map(|&c| super::write::dc_from_code(c) as f32);
        let rest = row(5, sh_width).iter().map(|&c| (f32::from(c) - 128.0) / 128.0);
        let sh: Vec<f32> = dc.chain(rest).collect();
        asset.sh.extend(yup::sh(&sh));
        asset.sh_degrees.push(header.sh_degree as u8);
        asset.maps.push(AssetMap::default());
    }
    if asset.positions.len() != n {
        return Err(Error::invalid(path, "splats are missing"));
    }
    Ok((asset, thick))
}

/// The metadata in our extension record, if there is one; the error says why they cannot be read.
fn own_meta(bytes: &[u8], header: &Header) -> Option<Result<Meta, String>> {
    let mut at = HEADER_BYTES;
    while header.has_extensions && at.checked_add(8)? <= header.toc_offset.min(bytes.len()) {
        let (kind, length) = (word(bytes, at)?, word(bytes, at + 4)? as usize);
        let value = bytes.get(at + 8..(at + 8).checked_add(length)?)?;
        if kind == META_RECORD && length <= crate::meta::META_BYTES_MAX {
            return Some(serde_json::from_slice(value).map_err(|e| e.to_string()));
        }
        at = (at + 8).checked_add(length)?;
    }
    None
}
