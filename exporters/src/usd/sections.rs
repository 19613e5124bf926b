//! The sizes of the parts of a file.

use super::names::*;
use crate::{Describes, Section};

/// The sizes of a layer and its parts.
pub(super) struct LayerBytes<'a> {
    pub(super) all: u64,
    /// Bytes of the tables of a binary layer.
    pub(super) tables: Option<u64>,
    /// Path of a property, and bytes of its value or its text.
    pub(super) values: &'a [(String, u64)],
}

/// Parts of a file. `images` are the entries of a package but the layer; `texture_bytes` those of pages in sidecar files,
/// which count as parts of the file.
pub(super) fn of(
    layer: &LayerBytes<'_>,
    images: Option<&[(String, u64)]>,
    file_bytes: u64,
    texture_bytes: u64,
) -> Vec<Section> {
    let mut sections = Vec::new();
    let mut add = |name: &str, describes, bytes| Section::add(&mut sections, name, describes, bytes);
    let layer_bytes = layer.all;
    let mut left = layer_bytes;
    for (place, bytes) in layer.values {
        let (name, describes) = class(place);
        add(name, describes, *bytes);
        left = left.saturating_sub(*bytes);
    }
    match layer.tables {
        Some(tables) => {
            add("tables", Describes::Other, tables.min(left));
            add("padding", Describes::Other, left.saturating_sub(tables));
        }
        None => add("text", Describes::Other, left),
    }
    for (name, bytes) in images.unwrap_or_default() {
        let is_page = name.rsplit('/').next().is_some_and(|file| file.starts_with("page"));
        let (name, describes) =
            if is_page { ("texels", Describes::Texels) } else { ("fallback", Describes::Other) };
        add(name, describes, *bytes);
        left = left.saturating_add(*bytes);
    }
    let inside: u64 = images.unwrap_or_default().iter().map(|(_, bytes)| bytes).sum();
    add("package", Describes::Other, file_bytes.saturating_sub(layer_bytes + inside));
    add("texels", Describes::Texels, texture_bytes);
    sections
}

/// Name of the part to which a value belongs. Arrays that variants share count where they come first.
fn class(place: &str) -> (&'static str, Describes) {
    let is_textured = !place.contains("=splat3d}") && !place.contains("=mesh}");
    let property = place.rsplit_once(&format!("{SPLATS}.")).filter(|_| is_textured).map(|(_, name)| name);
    match property {
        Some(POSITIONS) => ("positions", Describes::Splats),
        Some(ORIENTATIONS) => ("rotations", Describes::Splats),
        Some(SCALES) => ("scales", Describes::Splats),
        Some(OPACITIES) => ("opacities", Describes::Splats),
        // Its degree 0 contains the means of maps, for other programs.
        Some(SH_COEFFICIENTS) => ("sh", Describes::Splats),
        Some(OWN_SH_DEGREE) => ("sh_degrees", Describes::Splats),
        Some(SH0) => ("sh0", Describes::Splats),
        Some(RECT | PAGE | TEXEL_SIZE | SHIFT) => ("maps", Describes::Splats),
        _ if is_textured => ("metadata", Describes::Other),
        _ => ("fallback", Describes::Other),
    }
}
