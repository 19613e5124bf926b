//! Checks a file against the rules of `KHR_gaussian_splatting` that general validators do not know, and against our own.
//! Unlike a reader it goes on after the first offence.

mod data;
mod fallback;
mod structure;
mod texture;

use super::extension::Digest;
use super::loaded::{Loaded, SideFiles};
use super::mesh::is_quad_mesh;
use super::scene::{self, Found};
use super::{KHR, container, read};
use crate::{Error, Issue, ReadLimits, Severity};
use std::path::Path;

/// Code by which a mesh of quads is told: such a file is no asset, but may be sound.
pub(crate) const QUADS_CODE: &str = "LT1019";

/// Most offences of a kind that are told one by one; then one issue counts the rest.
const TOLD_MAX: usize = 3;

/// Most issues; a hostile file has no end of them.
const ISSUES_MAX: usize = 1000;

/// Primitives of splats whose numbers are looked at; there should be one.
const PRIMITIVES_MAX: usize = 4;

/// Checks the bytes of a `.glb` or `.gltf`; files beside it are looked for in the folder of `path`. No issues, or none
/// above [`Severity::Info`]: the file is sound. Codes:
///
/// | code | what is wrong |
/// |---|---|
/// | LT1001 | the file cannot be opened: container, JSON, buffers, version, a required extension |
/// | LT1002 | an extension is used, but not in `extensionsUsed`, or not used |
/// | LT1003 | `extensionsRequired` names our extension, which viewers can do without |
/// | LT1004 | no primitive of splats, or several |
/// | LT1005 | the primitive's mode is not POINTS |
/// | LT1006 | a property of `KHR_gaussian_splatting` is missing or unknown |
/// | LT1007 | an attribute is missing, of a type that is not allowed, or outside of its buffer |
/// | LT1008 | attributes have different counts |
/// | LT1009 | SH degrees are incomplete |
/// | LT1010 | an element of an attribute is not aligned to four bytes |
/// | LT1011 | POSITION without bounds, or wrong ones |
/// | LT1012 | a rotation is not a unit quaternion |
/// | LT1013 | a scale is not positive |
/// | LT1014 | an opacity is not in (0, 1] |
/// | LT1015 | a number is not finite |
/// | LT1016 | no COLOR_0 for viewers that know no splats |
/// | LT1017 | the node's transform is no similarity, or its tree is broken |
/// | LT1018 | a file beside it that holds a buffer is missing or cannot be read |
/// | LT1019 | no offence: the file is a mesh of quads, a preview without splats |
/// | LT1020 | the extension's version is not known |
/// | LT1021 | a property of the extension is missing or wrong |
/// | LT1022 | rectangles leave their page or do not fit the pages |
/// | LT1023 | rectangles overlap |
/// | LT1024 | a page is missing, damaged or of another size |
/// | LT1025 | the content is not what its hash says |
/// | LT1026 | a tool has dropped the textures |
/// | LT1027 | the digest in `extras` is missing or not that of the content |
/// | LT1028 | thick splats, which surfels cannot show |
/// | LT1029 | the reader refuses the file for another reason |
/// | LT1030 | something is odd: a moved node, an unknown kernel |
/// | LT1031 | SH of degree 0 is not the exact one with the mean of the map in it: splat viewers show wrong colours |
/// | LT1032 | the third scale is not positive and the smallest: splat viewers show no discs |
/// | LT1033 | COLOR_0 is not the colour of degree 0 and the opacity: other viewers show wrong points |
pub fn validate(bytes: &[u8], path: &Path) -> Vec<Issue> {
    let mut issues = Issues::default();
    let limits = ReadLimits::default();
    let loaded = match Loaded::new(bytes, path, &limits, SideFiles::Read) {
        Ok(loaded) => loaded,
        Err(e) => {
            // Buffers beside it are all that is read from elsewhere so far.
            let is_elsewhere = matches!(e, Error::Io { .. });
            issues.error(if is_elsewhere { "LT1018" } else { "LT1001" }, "", text_of(e));
            return issues.list;
        }
    };
    let json = container::parts(bytes, path).ok().map(|p| serde_json::from_slice(p.json));
    match json {
        Some(Ok(json)) => structure::check_extensions(&json, &mut issues),
        // The reader skips what it does not know, however deep.
        Some(Err(e)) => issues.error("LT1001", "", format!("JSON of the file: {e}")),
        None => {}
    }
    let found: Vec<Found<'_>> = scene::splat_primitives(&loaded.document).collect();
    for found in found.iter().take(PRIMITIVES_MAX) {
        check_primitive(&loaded, found, &mut issues);
    }
    match (scene::find(&loaded.document, path), found.first()) {
        (Err(_), None) if is_quad_mesh(&loaded.document) => {
            issues.push(QUADS_CODE, Severity::Info, "/meshes", scene::QUADS_ONLY.to_owned());
            structure::check_mesh(&loaded, &mut issues);
        }
        (Err(e @ Error::Invalid { .. }), None) => issues.error("LT1026", "/meshes", text_of(e)),
        (Err(e), _) => issues.error("LT1004", "/meshes", text_of(e)),
        (Ok(found), _) => check_reading(bytes, &loaded, &found, &limits, &mut issues),
    }
    issues.list
}

fn check_primitive(loaded: &Loaded<'_>, found: &Found<'_>, issues: &mut Issues) {
    structure::check_primitive(loaded, found, issues);
    data::check(loaded, found, issues);
    match found.splatting.texture() {
        Some(value) => texture::check(loaded, found, value, issues),
        None => {
            if let Some(digest) = Digest::find(found.primitive) {
                issues.error("LT1026", &found.pointer, scene::lost(&digest));
            }
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
    let has_errors = issues.list.iter().any(|i| i.severity == Severity::Error);
    let fresh = Loaded::new(bytes, loaded.path, limits, SideFiles::Read);
    let contents = fresh.and_then(|fresh| read::contents(&fresh, container::is_glb(bytes)));
    let contents = match contents {
        Ok(contents) => contents,
        // Most likely what was found before.
        Err(_) if has_errors => return,
        Err(e) => return issues.error("LT1029", "", text_of(e)),
    };
    for warning in contents.warnings {
        // These are errors of their own.
        if ["hash", "dropped", "quality"].iter().any(|word| warning.contains(word)) {
            continue;
        }
        let code = if warning.contains("thick") { "LT1028" } else { "LT1030" };
        issues.push(code, Severity::Info, &found.pointer, warning);
    }
    let Some(expected) = contents.hash else { return };
    fallback::check(loaded, found, &contents.asset, issues);
    let place = format!("{}/extensions/{KHR}/extensions/{}/hash", found.pointer, super::EXTENSION);
    let hash = contents.asset.hash();
    if expected != hash {
        let what = format!("hash {expected:016x}, the content has {hash:016x}: values were changed");
        issues.error("LT1025", &place, what);
    }
    let place = format!("{}/extras/litetex", found.pointer);
    match Digest::find(found.primitive) {
        Some(digest) if digest == Digest::of(&contents.asset, expected) => {}
        Some(digest) => {
            let what = format!("{digest:?}, expected {:?}", Digest::of(&contents.asset, expected));
            issues.error("LT1027", &place, what);
        }
        None => {
            let what = "no digest: a loss of the textures would not be noticed".to_owned();
            issues.push("LT1027", Severity::Warning, &place, what);
        }
    }
}

/// What was found so far.
#[derive(Default)]
struct Issues {
    list: Vec<Issue>,
}

impl Issues {
    fn push(&mut self, code: &'static str, severity: Severity, place: &str, message: String) {
        if self.list.len() < ISSUES_MAX {
            self.list.push(Issue { code, severity, place: place.to_owned(), message });
        }
    }

    fn error(&mut self, code: &'static str, place: &str, message: impl Into<String>) {
        self.push(code, Severity::Error, place, message.into());
    }

    /// Offences of many splats: the first few, then their number.
    fn many(&mut self, code: &'static str, place: &str, offences: impl Iterator<Item = String>) {
        let mut count = 0;
        for offence in offences {
            count += 1;
            if count <= TOLD_MAX {
                self.error(code, place, offence);
            }
        }
        if count > TOLD_MAX {
            self.error(code, place, format!("and {} more", count - TOLD_MAX));
        }
    }
}

/// An error without the path, which the caller knows.
fn text_of(error: Error) -> String {
    match error {
        Error::Io { path, source } => format!("{}: {source}", path.display()),
        Error::Invalid { what, .. } | Error::Unsupported { what, .. } | Error::TooLarge { what, .. } => what,
    }
}
