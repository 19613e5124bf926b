//! The files of scenes as pages get them: an asset that the page reads as it is, anything else as a lossless `.ltgs` file.

use super::sources::read_limits;
use crate::viewer::AssetBytes;
use litetex_exporters::html::SessionAsset;
use litetex_exporters::ltgs::{Effort, LtgsOptions, encode};
use litetex_exporters::{Format, Quality, SplatAsset, html, read_file};
use litetex_gs::verify::BakedScene;
use litetex_gs::{Error, Result};
use std::path::Path;

/// Extension of the files that the page gets.
pub const LTGS: &str = "ltgs";

/// The bytes of a scene and what describes them.
///
/// # Errors
/// If the scene breaks a rule of `.ltgs`, or the file has gone since it was read.
pub fn served(scene: &BakedScene) -> Result<(SessionAsset, AssetBytes)> {
    let name = name_of(&scene.path);
    match Format::from_path(&scene.path).filter(|_| scene.contents.is_some()) {
        Some(format) if is_read_by_page(format, scene) => {
            let bytes = litetex_exporters::regular_file_bytes(&scene.path)?;
            let asset = described(format.extension(), name, bytes);
            Ok((asset, AssetBytes::File(scene.path.clone())))
        }
        Some(Format::Html) => {
            let page = read_file(&scene.path, read_limits().decoded_bytes)?;
            Ok(in_memory(html::embedded(&page, &scene.path)?, name))
        }
        _ => Ok(in_memory(quick(&scene.asset).map_err(|e| Error::from(e.at(&scene.path)))?, name)),
    }
}

/// Whether the page reads the file itself: our formats, not what other programs write into theirs.
fn is_read_by_page(format: Format, scene: &BakedScene) -> bool {
    let states_quality = scene.contents.as_ref().is_some_and(|contents| contents.quality.is_some());
    format == Format::Ltgs || format == Format::Glb && states_quality
}

/// A `.ltgs` file that keeps every bit and is soon made.
///
/// # Errors
/// As [`encode`].
pub fn quick(asset: &SplatAsset) -> litetex_exporters::Result<Vec<u8>> {
    encode(
        asset,
        &LtgsOptions { quality: Quality::Lossless, effort: Effort::Quick, ..LtgsOptions::default() },
    )
}

/// A `.ltgs` file in memory.
pub fn in_memory(bytes: Vec<u8>, name: String) -> (SessionAsset, AssetBytes) {
    (described(LTGS, name, bytes.len() as u64), AssetBytes::Memory(bytes.into()))
}

/// What describes a file.
pub fn described(format: &str, name: String, bytes: u64) -> SessionAsset {
    SessionAsset { bytes, format: format.to_owned(), name, ..SessionAsset::default() }
}

/// The last part of a path, for people.
pub fn name_of(path: &Path) -> String {
    // Of `.` and `..` only the whole path has a name.
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let absolute = || Some(path.canonicalize().ok()?.file_name()?.to_string_lossy().into_owned());
    name.or_else(absolute).unwrap_or_default()
}
