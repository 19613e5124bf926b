//! Baked scenes: read from an asset's file, or baked from the state of a training.

use crate::backend::Backend;
use crate::bake::bake;
use crate::model::{AdamState, Model};
use crate::rounding::Quantisation;
use crate::{Report, Result};
use litetex_exporters::{AssetCamera, Contents, Provenance, ReadLimits, SplatAsset, read_asset};
use std::path::{Path, PathBuf};

/// A baked scene and the file that it comes from.
pub struct BakedScene {
    /// The scene.
    pub asset: SplatAsset,
    /// A checkpoint or an asset; names the scene in messages.
    pub path: PathBuf,
    /// What else the file of an asset holds; its `asset` has been moved out. `None` for a checkpoint.
    pub contents: Option<Box<Contents>>,
    /// How its numbers are rounded, if it was trained as its file will hold it.
    pub quantisation: Option<Quantisation>,
}

impl BakedScene {
    /// Reads an asset.
    ///
    /// # Errors
    /// As the reader of the asset's format.
    pub fn read(path: &Path, limits: &ReadLimits) -> Result<Self> {
        let mut contents = read_asset(path, limits)?;
        let asset = std::mem::take(&mut contents.asset);
        Ok(Self { asset, path: path.to_owned(), contents: Some(Box::new(contents)), quantisation: None })
    }
}

/// Bakes the state of a training: the backend flushes lazily updated parameters first.
///
/// # Errors
/// What the backend reports.
pub fn bake_checkpoint(
    backend: &mut dyn Backend,
    (model, adam): (&Model, &AdamState),
    cameras: Vec<AssetCamera>,
    background: [f32; 3],
    provenance: Provenance,
    report: &mut Report,
) -> Result<SplatAsset> {
    backend.upload(model, adam)?;
    let model = backend.read_flushed()?;
    Ok(bake(&model, cameras, background, provenance, report))
}
