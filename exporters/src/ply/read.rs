//! Reads PLY files of splats by any program: properties in any order, further ones ignored, normals
//! and higher SH optional, two or three scales.

use super::header::{Element, Encoding, Header};
use super::scalar::Scalar;
use crate::limits::{room_for_splats, splat_bytes};
use crate::{AssetMap, Error, ReadLimits, Result, SPLATS_MAX, SplatAsset, num_sh_coefficients};
use std::path::Path;

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct PlyContents {
    /// Activated splats without maps; local frame = the file's frame.
    pub asset: SplatAsset,
    /// Whether the file has no third scale.
    pub is_surfel: bool,
    /// Splats whose thinnest axis is more than a tenth of the next: drawn as discs they look different.
    pub num_thick: usize,
    /// Comments of the header in order.
    pub comments: Vec<String>,
}

/// A splat is a disc while its thickness is at most this share of its smaller other scale.
const DISC_THICKNESS: f64 = 0.1;

/// Reads a file. See [`decode_ply`].
///
/// # Errors
/// As [`decode_ply`], and [`Error::Io`].
pub fn read_ply(path: &Path, limits: &ReadLimits) -> Result<PlyContents> {
    let bytes = crate::gltf::read_at_most(path, limits.decoded_bytes)?;
    decode_ply(&bytes, path, limits)
}

/// Where each quantity stands in a row.
struct Columns {
    position: [usize; 3],
    dc: [usize; 3],
    rest: Vec<usize>,
    sh_degree: u32,
    opacity: usize,
    scales: Vec<usize>,
    rotation: [usize; 4],
}

impl Columns {
    fn find(vertex: &Element, path: &Path) -> Result<Self> {
        let index = |name: &str| vertex.properties.iter().position(|p| p.name == name);
        let required = |name: &str| {
            index(name).ok_or_else(|| {
                Error::invalid(
                    path,
                    format!("element \"vertex\" has no property {name:?}: not a file of splats"),
                )
            })
        };
        let numbered = |name: &str| (0..).map_while(|i| index(&format!("{name}_{i}"))).collect::<Vec<_>>();
        let rest = numbered("f_rest");
        let sh_degree =
            (0..=3).find(|&d| 3 * (num_sh_coefficients(d) - 1) == rest.len()).ok_or_else(|| {
                Error::unsupported(
                    path,
                    format!("{} properties f_rest_*; supported: 0, 9, 24, 45", rest.len()),
                )
            })?;
        let mut scales = vec![required("scale_0")?, required("scale_1")?];
        scales.extend(index("scale_2"));
        Ok(Self {
            position: [required("x")?, required("y")?, required("z")?],
            dc: [required("f_dc_0")?, required("f_dc_1")?, required("f_dc_2")?],
            rest,
            sh_degree,
            opacity: required("opacity")?,
            scales,
            rotation: [required("rot_0")?, required("rot_1")?, required("rot_2")?, required("rot_3")?],
        })
    }
}

/// Decodes the bytes of a file; `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`] if the file is damaged or no file of splats, [`Error::Unsupported`] for
/// big-endian files, lists and SH degrees above 3, [`Error::TooLarge`].
pub fn decode_ply(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<PlyContents> {
    let header = Header::parse(bytes, path)?;
    let at = header.elements.iter().position(|e| e.name == "vertex");
    let at = at.ok_or_else(|| Error::invalid(path, "no element \"vertex\""))?;
    let vertex = &header.elements[at];
    let scalars: Vec<Scalar> = vertex
        .properties
        .iter()
        .map(|p| {
            p.scalar
                .ok_or_else(|| Error::unsupported(path, format!("list property {:?} of \"vertex\"", p.name)))
        })
        .collect::<Result<_>>()?;
    if vertex.count > SPLATS_MAX {
        return Err(Error::too_large(path, format!("{} splats, at most {SPLATS_MAX}", vertex.count)));
    }
    let columns = Columns::find(vertex, path)?;
    let decoded = splat_bytes(columns.sh_degree) * vertex.count as u64;
    limits.check(decoded, &format!("{} splats", vertex.count), path)?;
    let data = bytes.get(header.num_bytes..).unwrap_or_default();
    // As many as the data could hold: a byte for each property, or a digit and a blank.
    let room = vertex.count.min(data.len() / vertex.properties.len().max(1));
    let mut contents = PlyContents {
        asset: room_for_splats(room, columns.sh_degree).map_err(|e| e.at(path))?,
        is_surfel: columns.scales.len() == 2,
        num_thick: 0,
        comments: header.comments.clone(),
    };
    take_provenance(&mut contents);
    match header.encoding {
        Encoding::BinaryLittleEndian => {
            let mut values = Vec::with_capacity(scalars.len());
            for row in binary_rows(data, &header.elements[..at], vertex, path)? {
                let mut rest = row;
                values.clear();
                for scalar in &scalars {
                    // `binary_rows` made the row long enough.
                    values.push(scalar.read(rest).unwrap_or(f64::NAN));
                    rest = &rest[scalar.num_bytes()..];
                }
                push_splat(&mut contents, &columns, &values, path)?;
            }
        }
        Encoding::Ascii => read_ascii(&mut contents, &columns, data, &header.elements[..=at], path)?,
    }
    contents.asset.validate().map_err(|e| e.at(path))?;
    Ok(contents)
}

/// Rows of the vertices of a binary file, after checking that the file holds them.
fn binary_rows<'a>(
    data: &'a [u8],
    before: &[Element],
    vertex: &Element,
    path: &Path,
) -> Result<impl Iterator<Item = &'a [u8]>> {
    let mut skipped = 0_usize;
    for element in before {
        let row = element.row_bytes().ok_or_else(|| {
            Error::unsupported(path, format!("lists in element {:?} before \"vertex\"", element.name))
        })?;
        skipped = row
            .checked_mul(element.count)
            .and_then(|size| size.checked_add(skipped))
            .ok_or_else(|| Error::invalid(path, format!("count of element {:?}", element.name)))?;
    }
    let row = vertex.row_bytes().unwrap_or_default();
    let needed = row.checked_mul(vertex.count);
    let found = data.len().saturating_sub(skipped);
    match needed {
        Some(needed) if needed <= found && row > 0 => {
            Ok(data[data.len() - found..][..needed].chunks_exact(row))
        }
        _ => Err(Error::invalid(
            path,
            format!(
                "{} splats of {row} bytes each, but {found} bytes of data: the file is cut or damaged",
                vertex.count
            ),
        )),
    }
}

/// Reads the rows of a text file: one line per row.
fn read_ascii(
    contents: &mut PlyContents,
    columns: &Columns,
    data: &[u8],
    elements: &[Element],
    path: &Path,
) -> Result<()> {
    let text = std::str::from_utf8(data).map_err(|e| Error::invalid(path, format!("ascii data: {e}")))?;
    let Some((vertex, before)) = elements.split_last() else {
        return Ok(());
    };
    let mut lines = text.lines();
    for element in before {
        if element.count > 0 && lines.nth(element.count - 1).is_none() {
            return Err(Error::invalid(path, format!("element {:?} is cut", element.name)));
        }
    }
    for splat in 0..vertex.count {
        let line = lines.next().unwrap_or_default();
        let values: Vec<f64> = line.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
        if values.len() != vertex.properties.len() {
            return Err(Error::invalid(
                path,
                format!("splat {splat}: {} numbers, expected {}", values.len(), vertex.properties.len()),
            ));
        }
        push_splat(contents, columns, &values, path)?;
    }
    Ok(())
}

/// Activates one row.
fn push_splat(contents: &mut PlyContents, columns: &Columns, values: &[f64], path: &Path) -> Result<()> {
    let asset = &mut contents.asset;
    let splat = asset.num_splats();
    let offence = |what: String| Err(Error::invalid(path, format!("splat {splat}: {what}")));

    let quaternion = columns.rotation.map(|c| values[c]);
    let norm = quaternion.iter().map(|v| v * v).sum::<f64>().sqrt();
    if !(norm > 0.0 && norm.is_finite()) {
        return offence(format!("rotation {quaternion:?} is no quaternion of a rotation"));
    }
    let mut quaternion = quaternion.map(|v| v / norm);
    let mut scales = [0.0; 3];
    for (scale, &c) in scales.iter_mut().zip(&columns.scales) {
        // Too small for f32 is as small as f32 can be; NaN stays and is refused.
        *scale = values[c].exp().clamp(f64::from(f32::MIN_POSITIVE), f64::INFINITY);
    }
    if columns.scales.len() == 3 {
        (quaternion, scales) = thinnest_last(quaternion, scales);
        contents.num_thick += usize::from(is_thick(scales));
    }
    asset.positions.push(columns.position.map(|c| values[c] as f32));
    asset.rotations.push(quaternion.map(|v| v as f32));
    asset.scales.push([scales[0] as f32, scales[1] as f32]);
    let opacity = (1.0 / (1.0 + (-values[columns.opacity]).exp())) as f32;
    asset.opacities.push(opacity.clamp(f32::MIN_POSITIVE, 1.0));
    asset.sh.extend(columns.dc.map(|c| values[c] as f32));
    let per_channel = columns.rest.len() / 3;
    for k in 0..per_channel {
        let coefficient = |channel: usize| values[columns.rest[channel * per_channel + k]] as f32;
        asset.sh.extend((0..3).map(coefficient));
    }
    asset.maps.push(AssetMap::default());
    Ok(())
}

/// Whether a splat looks different as a disc.
pub(crate) fn is_thick(scales: [f64; 3]) -> bool {
    scales[2] > DISC_THICKNESS * scales[0].min(scales[1])
}

/// Renames the axes cyclically so that the thinnest is z.
pub(crate) fn thinnest_last([w, x, y, z]: [f64; 4], s: [f64; 3]) -> ([f64; 4], [f64; 3]) {
    if s[2] <= s[0] && s[2] <= s[1] {
        ([w, x, y, z], s)
    } else if s[0] <= s[1] {
        // New axes (y, z, x): times (1 + i + j + k) / 2.
        let q = [w - x - y - z, w + x + y - z, w - x + y + z, w + x - y + z];
        (q.map(|v| 0.5 * v), [s[1], s[2], s[0]])
    } else {
        // New axes (z, x, y): times (1 - i - j - k) / 2.
        let q = [w + x + y + z, -w + x - y + z, -w + x + y - z, -w - x + y + z];
        (q.map(|v| 0.5 * v), [s[2], s[0], s[1]])
    }
}

/// Facts that our writer leaves in comments.
fn take_provenance(contents: &mut PlyContents) {
    let facts = &mut contents.asset.provenance;
    for comment in &contents.comments {
        let Some((name, text)) = comment.split_once(": ") else {
            continue;
        };
        match name {
            "title" => facts.title = text.to_owned(),
            "author" => facts.author = text.to_owned(),
            "licence" => facts.licence = text.to_owned(),
            "source" => facts.source = text.to_owned(),
            "program_version" => facts.program_version = text.to_owned(),
            "training" => {
                if let Some((name, value)) = text.split_once(" = ") {
                    facts.training.insert(name.to_owned(), value.to_owned());
                }
            }
            _ => {}
        }
    }
}
