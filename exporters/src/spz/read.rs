//! Reads SPZ of versions 1 to 4 by any program.

use super::container::{Container, Header, Stream};
use super::coordinates::Coordinates;
use super::extensions::Extensions;
use super::{ANTIALIASED, NAMES, float16, gzip, rotation, zstd_streams};
use crate::asset::meta::{META_BYTES_MAX, Meta};
use crate::fallback::broken::BrokenSplats;
use crate::fallback::ellipsoid;
use crate::files::limits::room_for_splats;
use crate::files::read::read_file;
use crate::math::sh::dropped_sh;
use crate::math::yup;
use crate::{
    AssetCamera, AssetMap, Contents, Describes, Error, Filter, ReadLimits, Result, Section, SplatAsset,
    num_sh_coefficients, text,
};
use std::path::Path;

/// Reads a file. See [`decode_spz`].
///
/// # Errors
/// As [`decode_spz`], and [`Error::Io`].
pub fn read_spz(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    decode_spz(&read_file(path, limits.decoded_bytes)?, path, limits)
}

/// Decodes the bytes of a file; `path` is only for messages. The asset is in the file's frame turned to y down, broken splats
/// of other programs left out. In our own files that is the capture's frame, and near plane, filter, background, texts of the
/// provenance and, if the file has them, cameras are those of the original asset, near plane and cameras converted to that
/// frame.
///
/// # Errors
/// [`Error::Invalid`] if the file is damaged or not an SPZ file, [`Error::Unsupported`] for newer versions,
/// [`Error::TooLarge`].
pub fn decode_spz(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let Container { header, streams, extensions } = unpack(bytes, path, limits)?;
    let Extensions { meta, coordinates, mut warnings } = extensions;
    let mut sections: Vec<Section> = Vec::new();
    for (name, stream) in NAMES.iter().zip(&streams) {
        let bytes = stream.packed_bytes;
        sections.push(Section { name: (*name).to_owned(), bytes, describes: Describes::Splats });
    }
    let rest = bytes.len() as u64 - sections.iter().map(|s| s.bytes).sum::<u64>();
    sections.push(Section { name: "metadata".to_owned(), bytes: rest, describes: Describes::Other });
    let (mut asset, thick, broken) = splats(&header, &streams, coordinates, path)?;
    if meta.is_some() {
        broken.refuse(path)?;
    } else {
        warnings.extend(broken.leave_out(&mut asset, path)?);
    }
    warnings.extend(dropped_sh(header.stored_sh_degree));
    if thick > 0 {
        warnings.push(format!("{thick} splats are thick: drawn as discs, they lose their thinnest axis"));
    }
    asset.filter = if header.flags & ANTIALIASED == 0 { Filter::None } else { Filter::Ewa };
    let meta = meta.filter(|text| text.len() <= META_BYTES_MAX);
    let meta = meta.map(|text| serde_json::from_slice::<Meta>(&text));
    if let Some(Err(what)) = &meta {
        warnings.push(text::message(format!("the metadata of this program are damaged: {what}")));
    }
    if let Some(Ok(meta)) = meta {
        // Splats are in the world frame; cameras are converted to it.
        let world_from_local = meta.world_from_capture.after(&meta.capture_from_local);
        asset.world_from_capture = meta.world_from_capture;
        asset.capture_from_local = meta.world_from_capture.inverse();
        asset.near = (f64::from(meta.near) * world_from_local.scale) as f32;
        asset.cameras =
            meta.cameras.into_iter().map(|c| AssetCamera::from(c).in_frame(&world_from_local)).collect();
        (asset.provenance, asset.background) = (meta.provenance, meta.background);
        (asset.colour_space, asset.filter) = (meta.colour_space, meta.filter);
    }
    asset.validate().map_err(|e| e.at(path))?;
    Ok(Contents {
        asset,
        format: format!("SPZ {}", header.version),
        quality: None,
        hash: None,
        sections,
        layers: Vec::new(),
        stand_in: None,
        warnings,
    })
}

/// The splats, how many are thick, and which are broken: those of version 1 may be, whose positions are floats.
fn splats(
    header: &Header,
    streams: &[Stream],
    coordinates: Option<Coordinates>,
    path: &Path,
) -> Result<(SplatAsset, usize, BrokenSplats)> {
    let (n, sh_degree) = (header.num_splats, header.sh_degree());
    let num_rest = 3 * (num_sh_coefficients(sh_degree) - 1);
    let mut asset = room_for_splats(n, sh_degree).map_err(|e| e.at(path))?;
    let step = 1.0 / f64::from(1_u32 << header.fractional_bits);
    let data = |i: usize| streams.get(i).map_or(&[][..], |s| &s.data);
    let (mut thick, mut broken) = (0, BrokenSplats::default());
    let turn = coordinates.map(Coordinates::turn);
    let widths = header.widths();
    for i in 0..n {
        let row = |stream: usize| &data(stream)[i * widths[stream]..(i + 1) * widths[stream]];
        let coordinate = |bytes: &[u8]| match *bytes {
            [low, high] => float16::decode(u16::from_le_bytes([low, high])),
            [low, middle, high] => f64::from(i32::from_le_bytes([0, low, middle, high]) >> 8) * step,
            _ => f64::NAN,
        };
        let p = row(0);
        let third = p.len() / 3;
        let position = [&p[..third], &p[third..2 * third], &p[2 * third..]].map(|b| coordinate(b) as f32);
        let position = turn.as_ref().map_or(position, |turn| turn.position(position));
        asset.positions.push(yup::position(position));
        asset.opacities.push((f32::from(row(1)[0]) / 255.0).max(f32::MIN_POSITIVE));
        let [x, y, z, w] = match *row(4) {
            [x, y, z] => rotation::decode_bytes([x, y, z]),
            ref code => rotation::decode(code.first_chunk().map_or(0, |b| u32::from_le_bytes(*b))),
        };
        let s = row(3);
        let scales = [s[0], s[1], s[2]].map(|c| (f64::from(c) / 16.0 - 10.0).exp());
        let q = turn.as_ref().map_or([w, x, y, z], |turn| turn.rotation([w, x, y, z]));
        let (q, scales) = ellipsoid::thinnest_last(q, scales);
        asset.rotations.push(yup::rotation_back(q.map(|v| v as f32)));
        asset.scales.push([scales[0] as f32, scales[1] as f32]);
        let dc = row(2).iter().map(|&c| super::write::dc_from_code(c) as f32);
        let rest = row(5)[..num_rest].iter().map(|&c| (f32::from(c) - 128.0) / 128.0);
        let sh: Vec<f32> = dc.chain(rest).collect();
        let sh = match &turn {
            Some(turn) => turn.sh(&sh),
            None => sh,
        };
        asset.sh.extend(yup::sh(&sh));
        asset.sh_degrees.push(sh_degree as u8);
        asset.maps.push(AssetMap::default());
        thick += usize::from(broken.is_sound(&asset, i) && ellipsoid::is_thick(scales));
    }
    if asset.positions.len() != n {
        return Err(Error::invalid(path, "splats are missing"));
    }
    Ok((asset, thick, broken))
}

/// Decompresses a file of any version.
///
/// # Errors
/// As [`decode_spz`].
fn unpack(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Container> {
    if bytes.starts_with(&gzip::MAGIC) {
        gzip::unpack(bytes, path, limits)
    } else {
        zstd_streams::unpack(bytes, path, limits)
    }
}
