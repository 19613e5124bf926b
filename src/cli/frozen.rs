//! Frozen scenes from whatever a user names: a run, a checkpoint or an asset. Rendering, exporting and verifying begin here.

use super::devices;
use super::eval::Trained;
use super::log::Log;
use super::memory::machine_bytes;
use super::summary::Summary;
use litetex_exporters::{Contents, Format, Provenance, ReadLimits, SplatAsset, read_asset};
use litetex_gs::bake::{asset_cameras, bake};
use litetex_gs::{Report, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A frozen scene and where it comes from.
pub struct Frozen {
    /// The scene.
    pub asset: SplatAsset,
    /// Its file.
    pub path: PathBuf,
    /// What it was made from.
    pub origin: Origin,
}

/// Kind of source.
pub enum Origin {
    /// A run or a checkpoint.
    Trained(Box<Trained>),
    /// An asset's file; its scene has been taken out.
    File(Box<Contents>),
}

impl Frozen {
    /// Loads what a path means.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn load(source: &Path, log: &Log) -> Result<Self> {
        if source.is_file() && Format::from_path(source).is_some() {
            return Self::read(source, log);
        }
        let trained = Trained::load(source)?;
        let (asset, report) = freeze(&trained, log)?;
        log.report(&report);
        Ok(Self { asset, path: trained.path.clone(), origin: Origin::Trained(Box::new(trained)) })
    }

    /// Reads an asset.
    ///
    /// # Errors
    /// As its format's reader.
    pub fn read(path: &Path, log: &Log) -> Result<Self> {
        let mut contents = read_asset(path, &read_limits())?;
        for warning in &contents.warnings {
            log.warn("asset", &format!("{}: {warning}", path.display()), 1);
        }
        let asset = std::mem::take(&mut contents.asset);
        Ok(Self { asset, path: path.to_owned(), origin: Origin::File(Box::new(contents)) })
    }

    /// The run that it comes from.
    pub fn trained(&self) -> Option<&Trained> {
        match &self.origin {
            Origin::Trained(trained) => Some(trained),
            Origin::File(_) => None,
        }
    }
}

/// How much memory an asset may take: the library's default, or half of what this machine has if that is more.
pub fn read_limits() -> ReadLimits {
    let default = ReadLimits::default().decoded_bytes;
    ReadLimits { decoded_bytes: machine_bytes().map_or(default, |bytes| default.max(bytes / 2)) }
}

/// The scene of a checkpoint with all lazy updates done, activated once.
fn freeze(trained: &Trained, log: &Log) -> Result<(SplatAsset, Report)> {
    let cameras = match &trained.cameras {
        Some(cameras) => cameras.clone(),
        // Older checkpoints have none.
        None => asset_cameras(&trained.open_capture(None)?),
    };
    let mut backend = devices::open("cpu", log)?;
    backend.upload(&trained.model, &trained.adam)?;
    let model = backend.read_flushed()?;
    let mut report = Report::default();
    let asset = bake(&model, cameras, trained.config.train.background, provenance(trained), &mut report);
    Ok((asset, report))
}

/// What is known of the training.
fn provenance(trained: &Trained) -> Provenance {
    let config = &trained.config;
    let name = config.data.as_deref().and_then(Path::file_name).unwrap_or_default();
    let name = name.to_string_lossy().into_owned();
    let train = &config.train;
    let mut training = BTreeMap::from([
        ("steps".to_owned(), trained.step.to_string()),
        ("profile".to_owned(), config.profile.name().to_owned()),
        ("policy".to_owned(), train.policy.to_string()),
        ("seed".to_owned(), train.seed.to_string()),
    ]);
    if let Some(psnr) = test_psnr(trained) {
        training.insert(PSNR_TEST.to_owned(), format!("{psnr:.3}"));
    }
    Provenance { title: name.clone(), source: name, training, ..Provenance::default() }
}

/// Name of the fact.
pub const PSNR_TEST: &str = "psnr_test";

/// Of the summary beside the checkpoint, if it is about the same step.
fn test_psnr(trained: &Trained) -> Option<f64> {
    let run = trained.path.parent()?.parent()?;
    let summary = Summary::read(&run.join("summary.json")).ok()?;
    (summary.steps == trained.step).then_some(summary.quality?.psnr)
}
