//! Loads the scene that a user names: a run, a checkpoint or an asset. Rendering, exporting and verifying start here.

use litetex_exporters::{Format, ReadLimits, SplatAsset, unknown_kind};
use litetex_gs::backend::Backend;
use litetex_gs::capture::{Capture, LoadOptions};
use litetex_gs::console::Log;
use litetex_gs::console::device;
use litetex_gs::memory::machine_bytes;
use litetex_gs::run::{RUN_OR_CHECKPOINT, Trained, is_checkpoint};
use litetex_gs::verify::BakedScene;
use litetex_gs::{Report, Result, usage};
use std::path::Path;

/// A backend that holds a trained scene.
///
/// # Errors
/// What the device reports.
pub fn on_device(trained: &Trained, name: &str, log: &Log) -> Result<Box<dyn Backend>> {
    let mut backend = device::open(name, log)?;
    backend.upload(&trained.model, &trained.adam)?;
    Ok(backend)
}

/// Extensions of splats that SuperSplat reads, beside those that we do.
const OF_SPLATS: [&str; 4] = ["splat", "ksplat", "sog", "lcc"];

/// Refuses a file that is neither a checkpoint nor an asset; the message names `others` that can be used as well.
///
/// # Errors
/// [`litetex_gs::Error::Unsupported`].
pub fn check_kind(source: &Path, others: &str) -> Result<()> {
    if !source.is_file() || is_asset(source) || is_checkpoint(source) {
        return Ok(());
    }
    let is_of_splats =
        source.extension().is_some_and(|e| OF_SPLATS.iter().any(|of| e.eq_ignore_ascii_case(of)));
    let advice = if is_of_splats { "; open it in SuperSplat and export it as PLY" } else { "" };
    let expected = format!("{}, {RUN_OR_CHECKPOINT}{others}{advice}", Format::all_named());
    Err(unknown_kind(source, &expected).into())
}

/// Whether a path is that of an asset, not of a run or a checkpoint.
pub fn is_asset(source: &Path) -> bool {
    source.is_file() && Format::from_path(source).is_some()
}

/// The baked scene of a run, a checkpoint or an asset, and the training it comes from, if it is not an asset.
///
/// # Errors
/// What reading it found.
pub fn load_scene(source: &Path, log: &Log) -> Result<(BakedScene, Option<Trained>)> {
    check_kind(source, "")?;
    if is_asset(source) {
        return Ok((read_scene(source, log)?, None));
    }
    let trained = Trained::load(source)?;
    let mut report = Report::default();
    let asset = trained.bake(device::open("cpu", log)?.as_mut(), &mut report)?;
    log.report(&report);
    // Of splats that are left out, no steps are known.
    let quantisation = trained.quantisation.clone().filter(|r| r.exponents.len() == asset.num_splats());
    Ok((BakedScene { asset, path: trained.path.clone(), contents: None, quantisation }, Some(trained)))
}

/// [`load_scene`], or the first layers of an asset.
///
/// # Errors
/// [`litetex_gs::Error::Usage`] if the source has no layers, or fewer.
pub fn load_layers(source: &Path, layers: Option<u32>, log: &Log) -> Result<(BakedScene, Option<Trained>)> {
    match layers {
        None => load_scene(source, log),
        Some(layers) if is_asset(source) => Ok((read_layers(source, Some(layers), log)?, None)),
        Some(layers) => Err(usage!(
            "--layers {layers}: {} is no asset; only .ltgs files and glTF files of quality tiny have layers",
            source.display()
        )),
    }
}

/// Reads an asset and logs its warnings.
///
/// # Errors
/// As the reader of the asset's format.
pub fn read_scene(path: &Path, log: &Log) -> Result<BakedScene> {
    read_layers(path, None, log)
}

/// [`read_scene`] of the first layers only; `None`: all.
///
/// # Errors
/// [`litetex_gs::Error::Usage`] if the asset has fewer layers.
fn read_layers(path: &Path, layers: Option<u32>, log: &Log) -> Result<BakedScene> {
    let scene = BakedScene::read(path, &ReadLimits { layers, ..read_limits() })?;
    if let Some(wanted) = layers {
        let found = scene.contents.as_ref().map_or(0, |contents| contents.layers.len());
        check_layers(path, wanted, found)?;
        if wanted == 0 && scene.contents.as_ref().is_none_or(|contents| contents.stand_in.is_none()) {
            let remedy = if found == 0 { "as only .ltgs files do" } else { "export one with --preview" };
            return Err(usage!("--layers 0: {} has no stand-in; {remedy}", path.display()));
        }
    }
    for warning in scene.contents.iter().flat_map(|contents| &contents.warnings) {
        log.warn("asset", &format!("{}: {warning}", path.display()), 1);
    }
    Ok(scene)
}

/// Refuses to read more layers than an asset has.
fn check_layers(path: &Path, wanted: u32, found: usize) -> Result<()> {
    let what = match found {
        0 => "has no layers, as only .ltgs files and glTF files of quality tiny do; leave --layers out"
            .to_owned(),
        1 => "has one layer".to_owned(),
        _ => format!("has {found} layers"),
    };
    if found >= wanted as usize {
        return Ok(());
    }
    Err(usage!("--layers {wanted}: {} {what}", path.display()))
}

/// Says which direction of the capture is up and why, if the scene knows.
pub fn say_up(asset: &SplatAsset, log: &Log) {
    if !asset.provenance.up.is_empty() {
        log.info(&format!("up is {}", asset.provenance.up));
    }
}

/// How much memory an asset may take: the library's default, or half of this machine's if that is more.
pub fn read_limits() -> ReadLimits {
    let default = ReadLimits::default().decoded_bytes;
    ReadLimits {
        decoded_bytes: machine_bytes().map_or(default, |bytes| default.max(bytes / 2)),
        layers: None,
    }
}

/// The capture of a scene: the named folder, else the run's own if it is still there.
///
/// # Errors
/// What the loader found in the folder; [`litetex_gs::Error::Usage`] if it is not the capture of the run.
pub fn open_photos(
    scene: &BakedScene,
    trained: Option<&Trained>,
    named: Option<&Path>,
    log: &Log,
) -> Result<Option<Capture>> {
    let capture = match (trained, named) {
        (Some(trained), _) if named.is_some() || trained.config.data().is_ok_and(Path::is_dir) => {
            trained.open_capture(named)?
        }
        (None, Some(folder)) => Capture::load(folder, &load_options(scene))?,
        _ => return Ok(None),
    };
    log.report(&capture.report);
    Ok(Some(capture))
}

/// How the capture of an asset is read: its cameras state the size of the images.
fn load_options(scene: &BakedScene) -> LoadOptions {
    let longer = scene.asset.cameras.iter().map(|c| c.width_px.max(c.height_px)).max();
    let mut options = LoadOptions { background: scene.asset.background, ..Default::default() };
    if let Some(longer) = longer {
        options.max_resolution = longer;
    }
    options
}
