//! Reads PLY files of splats by any program: properties in any order, unknown ones ignored, normals and higher SH optional,
//! two or three scales.

use super::columns::Columns;
use super::escape::unescaped;
use super::local_origin::local_origin;
use super::rows::Rows;
use super::{COMMENT_OURS, PlyUp};
use crate::fallback::broken::BrokenSplats;
use crate::fallback::ellipsoid::{is_thick, thinnest_last};
use crate::files::limits::{room_for_splats, splat_bytes};
use crate::files::read::read_file;
use crate::math::sh::dropped_sh;
use crate::{AssetMap, ReadLimits, Result, Section, SplatAsset, Transform, num_sh_coefficients};
use std::path::Path;

/// The contents of a PLY file.
#[derive(Clone, Debug, PartialEq)]
pub struct PlyContents {
    /// Activated splats without maps. The local frame is that of the file, moved to the splats if coordinates of f64 are
    /// finer than f32 can hold.
    pub asset: SplatAsset,
    /// Whether the file has no third scale, as those of 2DGS.
    pub is_surfel: bool,
    /// Splats whose thinnest axis is more than a tenth of the next: as discs they look different.
    pub num_thick: usize,
    /// Parts of the file by property; their sum is its size.
    pub sections: Vec<Section>,
    /// Comments of the header, in order.
    pub comments: Vec<String>,
    /// Which splats were broken and left out, as a warning; `None` if none were, as in our own files.
    pub left_out: Option<String>,
    /// What of the SH was left out, as a warning; `None` if all were kept.
    pub dropped_sh: Option<String>,
    /// What of the file's frame could not be undone, as a warning; `None` if all was.
    pub lost_frame: Option<String>,
}

/// Reads a file. See [`decode_ply`].
///
/// # Errors
/// As [`decode_ply`], and [`crate::Error::Io`].
pub fn read_ply(path: &Path, limits: &ReadLimits) -> Result<PlyContents> {
    decode_ply(&read_file(path, limits.decoded_bytes)?, path, limits)
}

/// Decodes the bytes of a file; `path` is only for messages. Broken splats of other programs are left out.
///
/// # Errors
/// [`crate::Error::Invalid`] if the file is damaged or no file of splats, or more than a tenth of its splats are broken,
/// [`crate::Error::Unsupported`] for big-endian files, lists and SH degrees above 4, [`crate::Error::TooLarge`].
pub fn decode_ply(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<PlyContents> {
    let rows = Rows::open(bytes, path)?;
    let columns = Columns::find(rows.vertex(), path)?;
    let count = rows.vertex().count;
    limits.check(splat_bytes(columns.sh_degree) * count as u64, &format!("{count} splats"), path)?;
    let mut contents = PlyContents {
        asset: room_for_splats(rows.room(), columns.sh_degree).map_err(|e| e.at(path))?,
        is_surfel: columns.scales.len() == 2,
        num_thick: 0,
        sections: rows.sections(),
        comments: rows.header.comments.clone(),
        left_out: None,
        dropped_sh: dropped_sh(columns.stored_sh_degree),
        lost_frame: None,
    };
    take_provenance(&mut contents);
    let origin = local_origin(&rows, &columns)?;
    if origin != [0.0; 3] {
        let asset = &mut contents.asset;
        asset.capture_from_local = asset.capture_from_local.after(&Transform::scaled_and_moved(1.0, origin));
    }
    let mut broken = BrokenSplats::default();
    rows.for_each(&mut |values| {
        push_splat(&mut contents, &columns, (values, origin), &mut broken);
        Ok(())
    })?;
    if is_ours(&contents.comments) {
        broken.refuse(path)?;
    } else {
        contents.left_out = broken.leave_out(&mut contents.asset, path)?;
    }
    contents.asset.validate().map_err(|e| e.at(path))?;
    Ok(contents)
}

/// Activates a row; `origin` is that of the local frame.
fn push_splat(
    contents: &mut PlyContents,
    columns: &Columns,
    (values, origin): (&[f64], [f64; 3]),
    broken: &mut BrokenSplats,
) {
    let asset = &mut contents.asset;
    let splat = asset.num_splats();
    let stored = columns.rotation.map(|c| values[c]);
    let norm = stored.iter().map(|v| v * v).sum::<f64>().sqrt();
    let is_rotation = norm > 0.0 && norm.is_finite();
    let mut quaternion = if is_rotation { stored.map(|v| v / norm) } else { [1.0, 0.0, 0.0, 0.0] };
    let mut scales = [0.0; 3];
    for (scale, &c) in scales.iter_mut().zip(&columns.scales) {
        // What is too small for f32 becomes its smallest number; NaN stays.
        *scale = values[c].exp().clamp(f64::from(f32::MIN_POSITIVE), f64::INFINITY);
    }
    let has_nan = scales.iter().any(|s| s.is_nan());
    let mut thick = false;
    if columns.scales.len() == 3 && !has_nan {
        (quaternion, scales) = thinnest_last(quaternion, scales);
        thick = is_thick(scales);
    }
    asset.positions.push(std::array::from_fn(|i| (values[columns.position[i]] - origin[i]) as f32));
    asset.rotations.push(quaternion.map(|v| v as f32));
    asset.scales.push([scales[0] as f32, scales[1] as f32]);
    let opacity = (1.0 / (1.0 + (-values[columns.opacity]).exp())) as f32;
    asset.opacities.push(opacity.clamp(f32::MIN_POSITIVE, 1.0));
    asset.sh.extend(columns.dc.map(|c| values[c] as f32));
    let per_channel = columns.rest.len() / 3;
    for k in 0..num_sh_coefficients(columns.sh_degree) - 1 {
        let coefficient = |channel: usize| values[columns.rest[channel * per_channel + k]] as f32;
        asset.sh.extend((0..3).map(coefficient));
    }
    asset.sh_degrees.push(columns.sh_degree as u8);
    asset.maps.push(AssetMap::default());
    if !is_rotation {
        broken.add(splat, &format!("rotation {stored:?} is not a rotation"));
    } else if has_nan {
        // The axis with it may be the one that is dropped.
        let found: Vec<f64> = columns.scales.iter().map(|&c| values[c]).collect();
        broken.add(splat, &format!("scales {found:?} (logarithms) are not numbers"));
    } else if broken.is_sound(asset, splat) {
        contents.num_thick += usize::from(thick);
    }
}

/// Whether our writer made a file with these comments.
fn is_ours(comments: &[String]) -> bool {
    comments.iter().any(|c| c.starts_with(COMMENT_OURS))
}

/// Takes the provenance that our writer leaves in comments.
fn take_provenance(contents: &mut PlyContents) {
    let (mut world, mut up, mut origin) = (None, None, None);
    let mut refers_to_world = false;
    let is_ours = is_ours(&contents.comments);
    let plain = |text: &str| if is_ours { unescaped(text) } else { text.to_owned() };
    let facts = &mut contents.asset.provenance;
    for comment in &contents.comments {
        let Some((name, text)) = comment.split_once(": ") else {
            continue;
        };
        match name {
            "world_from_capture" => world = Some(super::world_from_comment(text)),
            // Said by the writer where the frame is not the capture's.
            "frame" if is_ours => refers_to_world = text.contains("see world_from_capture"),
            "origin" if is_ours => origin = Some(super::origin_from_comment(text)),
            "up" => up = PlyUp::ALL.into_iter().find(|up| up.name() == text),
            "up_in_capture" => facts.up = plain(text),
            "scale" => facts.scale = plain(text),
            "title" => facts.title = plain(text),
            "author" => facts.author = plain(text),
            "licence" => facts.licence = plain(text),
            "source" => facts.source = plain(text),
            "program_version" => facts.program_version = plain(text),
            "training" => {
                // Blanks at the end of a line are lost.
                let pair = text.split_once(" = ").or_else(|| Some((text.strip_suffix(" =")?, "")));
                if let Some((name, value)) = pair {
                    facts.training.insert(plain(name), plain(value));
                }
            }
            _ => {}
        }
    }
    let up = up.filter(|_| is_ours).unwrap_or_default();
    let lost = match world {
        Some(Some(_)) => None,
        Some(None) => Some("holds no transform"),
        // Otherwise the frame is that of the capture or of another program.
        None => (refers_to_world || origin.is_some()).then_some("is missing"),
    };
    let mut world = world.flatten();
    if let Some(how) = lost {
        world =
            origin.flatten().map(|[x, y, z]| Transform::scaled_and_moved(1.0, [0.0 - x, 0.0 - y, 0.0 - z]));
        // The direction in the capture says nothing of this frame.
        facts.up.clear();
        let undone = match world {
            Some(_) => "only the origin that the file states is undone",
            None => "the splats stay where the file has them",
        };
        contents.lost_frame = Some(format!(
            "the comment world_from_capture {how}, so {undone}, and what is up is not known; export the file again, or choose \
             with --up"
        ));
    }
    if world.is_some() || up != PlyUp::default() {
        // Splats lie in the world, and in files with another axis up in one turned from it.
        let world = world.unwrap_or_default();
        contents.asset.world_from_capture = world;
        contents.asset.capture_from_local = up.turn().after(&world).inverse();
    }
}
