//! Checks a file against the rules of `KHR_gaussian_splatting` and of our extension in it. Plain glTF (JSON, buffer views,
//! accessors, bounds, nodes) is checked only as far as our reader needs it: Khronos' glTF validator checks the rest.
//! Unlike the reader, it continues after the first violation.

mod fallback;
mod splats;
mod texture;

use super::document::{Document, MODE_POINTS};
use super::extension::Digest;
use super::loaded::{Loaded, SidecarFiles};
use super::scene::{self, Found, is_quad_mesh};
use super::{EXTENSION, KHR, container, read, sh_attribute};
use crate::asset::hash::text_from_hash;
use crate::format::contents::Issues;
use crate::{Error, Issue, ReadLimits, Severity, quoted};
use std::path::Path;

/// Code that marks a mesh of quads: such a file is not an asset, but may be valid.
pub(crate) const QUADS_CODE: &str = "LT1019";

/// Primitives of splats whose numbers are looked at; there should be one.
const PRIMITIVES_MAX: usize = 4;

/// Checks the bytes of a `.glb` or `.gltf`; sidecar files are looked for in the folder of `path`. No issues, or none
/// above [`Severity::Info`]: the file is valid as far as it is checked here. Codes:
///
/// | code | what is wrong |
/// |---|---|
/// | LT1001 | the file cannot be opened: container, JSON, buffers, version, a required extension |
/// | LT1002 | our extension is used, but not in `extensionsUsed`, or the other way round |
/// | LT1003 | `extensionsRequired` names our extension, which viewers can do without |
/// | LT1004 | there is no primitive of splats, or there are several |
/// | LT1005 | the primitive's mode is not POINTS |
/// | LT1006 | a property of `KHR_gaussian_splatting` is missing or unknown |
/// | LT1007 | an attribute is missing, of a type that is not allowed, or outside its buffer |
/// | LT1009 | SH degrees are incomplete |
/// | LT1012 | a rotation is not a unit quaternion |
/// | LT1013 | a scale is not positive |
/// | LT1014 | an opacity is not in (0, 1] |
/// | LT1016 | there is no COLOR_0 for viewers without splat support |
/// | LT1018 | a sidecar file that holds a buffer is missing or cannot be read |
/// | LT1019 | nothing: the file is a mesh of quads, a preview without splats |
/// | LT1020 | the version of our extension is not known |
/// | LT1021 | a property of our extension is missing or wrong |
/// | LT1022 | rectangles leave their page or do not fit the pages |
/// | LT1023 | rectangles overlap |
/// | LT1024 | a page is missing, damaged or of another size |
/// | LT1025 | the content is not what its hash says |
/// | LT1026 | a tool has dropped the textures |
/// | LT1027 | the digest in `extras` is missing or not that of the content |
/// | LT1028 | thick splats, which discs cannot show |
/// | LT1029 | the reader refuses the file for another reason: attributes of different lengths, numbers that are not finite, nodes |
/// | LT1030 | something is odd: a moved node, an unknown kernel |
/// | LT1031 | SH of degree 0 is not the exact one with the mean of the map in it: splat viewers show wrong colours |
/// | LT1032 | the third scale is not positive and the smallest: splat viewers show no discs |
/// | LT1033 | COLOR_0 is not the colour of degree 0 and the opacity: other viewers show wrong points |
/// | LT1034 | the splats for other viewers are not those of the stream |
/// | LT1035 | texels around maps are not zero as far as `border` says |
/// | LT3001 to LT3009 | the stream: as for a `.ltgs` file |
pub fn validate(bytes: &[u8], path: &Path) -> Vec<Issue> {
    let mut issues = Issues::default();
    let limits = ReadLimits::default();
    let loaded = match Loaded::new(bytes, path, &limits, SidecarFiles::Read) {
        Ok(loaded) => loaded,
        Err(e) => {
            // So far, only buffers are read from sidecar files.
            let is_elsewhere = matches!(e, Error::Io { .. });
            issues.error(if is_elsewhere { "LT1018" } else { "LT1001" }, "", e.text());
            return issues.list;
        }
    };
    let found: Vec<Found<'_>> = scene::splat_primitives(&loaded.document).collect();
    check_extensions(&loaded.document, &found, &mut issues);
    for found in found.iter().take(PRIMITIVES_MAX) {
        check_primitive(&loaded, found, &mut issues);
    }
    match (scene::find(&loaded.document, path), found.first()) {
        (Err(_), None) if is_quad_mesh(&loaded.document) => {
            issues.info(QUADS_CODE, "/meshes", scene::QUADS_ONLY);
        }
        (Err(e @ Error::Invalid { .. }), None) => issues.error("LT1026", "/meshes", e.text()),
        (Err(e), _) => issues.error("LT1004", "/meshes", e.text()),
        (Ok(found), _) => check_reading(bytes, &loaded, &found, &limits, &mut issues),
    }
    issues.list
}

/// Our extension is listed exactly where it is used.
fn check_extensions(document: &Document, found: &[Found<'_>], issues: &mut Issues) {
    let is_used = found.iter().any(|f| f.splatting.texture().is_some());
    let is_listed = document.extensions_used.iter().any(|name| name == EXTENSION);
    let place = "/extensionsUsed";
    match (is_used, is_listed) {
        (true, false) => issues.error("LT1002", place, format!("{EXTENSION} is used, but not listed")),
        (false, true) => {
            let what = format!("{EXTENSION} is listed, but not used: a tool has dropped the textures");
            issues.warning("LT1002", place, what);
        }
        _ => {}
    }
    if document.extensions_required.iter().any(|name| name == EXTENSION) {
        let what = format!("{EXTENSION} is required: viewers without it refuse the file needlessly");
        issues.warning("LT1003", "/extensionsRequired", what);
    }
}

fn check_primitive(loaded: &Loaded<'_>, found: &Found<'_>, issues: &mut Issues) {
    if found.primitive.mode != Some(MODE_POINTS) {
        let what = format!("mode {:?}, expected 0 (POINTS)", found.primitive.mode);
        issues.error("LT1005", &format!("{}/mode", found.pointer), what);
    }
    check_khr(found, issues);
    check_attributes(found, issues);
    splats::check(loaded, found, issues);
    match found.splatting.texture() {
        Some(value) => texture::check(loaded, found, value, issues),
        None => {
            if let Some(digest) = found.primitive.digest() {
                issues.error("LT1026", &found.pointer, scene::lost(&digest));
            }
        }
    }
}

/// Properties of `KHR_gaussian_splatting`.
fn check_khr(found: &Found<'_>, issues: &mut Issues) {
    let place = format!("{}/extensions/{KHR}", found.pointer);
    let splatting = found.splatting;
    let mut check = |name: &str, value: &str, known: &[&str], severity: Severity| {
        if !known.contains(&value) {
            let what = format!("{}, known: {known:?}", quoted(value));
            issues.push("LT1006", severity, &format!("{place}/{name}"), what);
        }
    };
    let missing = if splatting.kernel.is_empty() { Severity::Error } else { Severity::Warning };
    check("kernel", &splatting.kernel, &["ellipse"], missing);
    let spaces = ["srgb_rec709_display", "lin_rec709_display"];
    check("colorSpace", &splatting.color_space, &spaces, Severity::Error);
    let projection = splatting.projection.as_deref().unwrap_or("perspective");
    check("projection", projection, &["perspective"], Severity::Warning);
    let sorting = splatting.sorting_method.as_deref().unwrap_or("cameraDistance");
    check("sortingMethod", sorting, &["cameraDistance"], Severity::Warning);
}

/// Attributes that must be there together.
fn check_attributes(found: &Found<'_>, issues: &mut Issues) {
    let place = format!("{}/attributes", found.pointer);
    let attributes = &found.primitive.attributes;
    if !attributes.contains_key("COLOR_0") {
        let what = "no COLOR_0: viewers without splat support show points without colours";
        issues.warning("LT1016", &place, what);
    }
    let highest = super::splats::sh_degree(found.primitive);
    for l in 0..=highest {
        let names = (0..=2 * l).map(|n| sh_attribute(l, n));
        let missing: Vec<String> = names.filter(|name| !attributes.contains_key(name)).collect();
        if !missing.is_empty() {
            let what = format!("{} missing, degree {highest} is there", missing.join(", "));
            issues.error("LT1009", &place, what);
        }
    }
}

/// What only shows when the file is read.
fn check_reading(
    bytes: &[u8],
    loaded: &Loaded<'_>,
    found: &Found<'_>,
    limits: &ReadLimits,
    issues: &mut Issues,
) {
    let fresh = Loaded::new(bytes, loaded.path, limits, SidecarFiles::Read);
    let contents = fresh.and_then(|fresh| read::contents(&fresh, container::is_glb(bytes)));
    let contents = match contents {
        Ok(contents) => contents,
        // Most likely what was found before.
        Err(_) if issues.has_errors() => return,
        Err(e) => return issues.error("LT1029", "", e.text()),
    };
    for warning in contents.warnings {
        // These are errors of their own.
        if ["hash", "dropped", "quality"].iter().any(|word| warning.contains(word)) {
            continue;
        }
        let code = if warning.contains("thick") { "LT1028" } else { "LT1030" };
        issues.info(code, &found.pointer, warning);
    }
    let Some(expected) = contents.hash else { return };
    fallback::check(loaded, found, &contents.asset, issues);
    let hash = contents.asset.hash();
    if expected != hash {
        let place = format!("{}/extensions/{KHR}/extensions/{EXTENSION}/hash", found.pointer);
        let what = format!("hash {expected:016x}, the content has {hash:016x}: values were changed");
        issues.error("LT1025", &place, what);
    }
    let place = format!("{}/extras/litetex", found.pointer);
    let stated = Digest::of(&contents.asset, text_from_hash(expected));
    match found.primitive.digest() {
        Some(digest) if digest == stated => {}
        Some(digest) => {
            let what = format!("{digest:?}, expected {stated:?}");
            issues.error("LT1027", &place, what);
        }
        None => issues.warning("LT1027", &place, "no digest: a loss of the textures would go unnoticed"),
    }
}
