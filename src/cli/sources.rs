//! Loads the scene that a user names: a run, a checkpoint or an asset. Rendering, exporting and verifying start here.

use super::capture::{self, Capture, LoadOptions};
use super::config_file::RunConfig;
use super::devices;
use super::log::Log;
use super::memory::machine_bytes;
use super::run_folder::find_checkpoint;
use super::summary::Summary;
use litetex_exporters::{AssetCamera, Format, Provenance, ReadLimits};
use litetex_gs::backend::{Backend, RenderOptions};
use litetex_gs::model::{AdamState, Model};
use litetex_gs::train::checkpoint;
use litetex_gs::verify::{BakedScene, CaptureIdentity, PSNR_TEST, bake_checkpoint, cameras_from_strings};
use litetex_gs::{Error, Report, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A trained scene as its checkpoint holds it.
pub struct Trained {
    /// The checkpoint.
    pub path: PathBuf,
    /// Steps done.
    pub step: u32,
    /// The scene; lazy updates may be pending.
    pub model: Model,
    /// The optimiser, from which pending updates are flushed.
    pub adam: AdamState,
    /// Settings of the run.
    pub config: RunConfig,
    /// The capture that it was trained on.
    pub identity: CaptureIdentity,
    /// Cameras of the run.
    pub cameras: Vec<AssetCamera>,
}

impl Trained {
    /// Loads a checkpoint, or the last one of a run.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::InvalidInput`], [`Error::Unsupported`].
    pub fn load(source: &Path) -> Result<Self> {
        if source.is_file() && Format::from_path(source).is_some() {
            return Err(Error::unsupported(
                source,
                "an asset; expected the folder of a run, or one of its checkpoints (step-*.safetensors)",
            ));
        }
        let path = find_checkpoint(source)?;
        let (state, strings) = checkpoint::load_without_history(&path)?;
        let config = config_of(&path, &strings)?;
        let identity = CaptureIdentity::from_strings(&path, &strings)?;
        let cameras = cameras_from_strings(&path, &strings)?;
        Ok(Self { path, step: state.step, model: state.model, adam: state.adam, config, identity, cameras })
    }

    /// A backend that holds the scene.
    ///
    /// # Errors
    /// What the device reports.
    pub fn on_device(&self, name: &str, log: &Log) -> Result<Box<dyn Backend>> {
        let mut backend = devices::open(name, log)?;
        backend.upload(&self.model, &self.adam)?;
        Ok(backend)
    }

    /// The capture that it was trained on, in its old place or `elsewhere`.
    ///
    /// # Errors
    /// What the loader found; [`Error::Usage`] if it is another capture.
    pub fn open_capture(&self, elsewhere: Option<&Path>) -> Result<Capture> {
        let path = match elsewhere {
            Some(path) => path,
            None => self.config.data()?,
        };
        let capture = capture::open(path, &self.config.capture)?;
        self.identity.check_frame(&CaptureIdentity::new(&capture, capture.capture_from_local))?;
        Ok(capture)
    }

    /// What an asset states about its training.
    fn provenance(&self) -> Provenance {
        let config = &self.config;
        let name = config.data.as_deref().and_then(Path::file_name).unwrap_or_default();
        let name = name.to_string_lossy().into_owned();
        let train = &config.train;
        let mut training = BTreeMap::from([
            ("steps".to_owned(), self.step.to_string()),
            ("profile".to_owned(), config.profile.name().to_owned()),
            ("policy".to_owned(), train.policy.to_string()),
            ("seed".to_owned(), train.seed.to_string()),
        ]);
        if let Some(psnr) = self.test_psnr() {
            training.insert(PSNR_TEST.to_owned(), format!("{psnr:.3}"));
        }
        Provenance { title: name.clone(), source: name, training, ..Provenance::default() }
    }

    /// The test PSNR in the summary of the run, if it belongs to the checkpoint's step.
    fn test_psnr(&self) -> Option<f64> {
        let run = self.path.parent()?.parent()?;
        let summary = Summary::read(&run.join("summary.json")).ok()?;
        (summary.steps == self.step).then_some(summary.quality?.psnr)
    }
}

/// The settings that a checkpoint carries.
///
/// # Errors
/// [`Error::InvalidInput`] if they are missing or unreadable.
pub fn config_of(path: &Path, strings: &BTreeMap<String, String>) -> Result<RunConfig> {
    let text = strings
        .get("config")
        .ok_or_else(|| Error::invalid(path, "the checkpoint carries no settings (\"config\")"))?;
    RunConfig::parse(path, text)
}

/// Render options of a model.
pub fn render_options(model: &Model, background: [f32; 3], geometry: bool) -> RenderOptions {
    RenderOptions { background, sh_degree: model.splats.sh_degree(), geometry }
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
    if is_asset(source) {
        return Ok((read_scene(source, log)?, None));
    }
    let trained = Trained::load(source)?;
    let mut report = Report::default();
    let asset = bake_checkpoint(
        devices::open("cpu", log)?.as_mut(),
        (&trained.model, &trained.adam),
        trained.cameras.clone(),
        trained.config.train.background,
        trained.provenance(),
        &mut report,
    )?;
    log.report(&report);
    Ok((BakedScene { asset, path: trained.path.clone(), contents: None }, Some(trained)))
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
/// [`Error::Usage`] if the asset has fewer layers.
pub fn read_layers(path: &Path, layers: Option<u32>, log: &Log) -> Result<BakedScene> {
    let scene = BakedScene::read(path, &ReadLimits { layers, ..read_limits() })?;
    if let Some(wanted) = layers {
        let found = scene.contents.as_ref().map_or(0, |contents| contents.layers.len());
        check_layers(path, wanted, found)?;
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
    Err(Error::Usage(format!("--layers {wanted}: {} {what}", path.display())))
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
/// What the loader found in the folder; [`Error::Usage`] if it is not the capture of the run.
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
        (None, Some(folder)) => capture::open(folder, &load_options(scene))?,
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
