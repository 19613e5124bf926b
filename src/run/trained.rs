//! A finished or interrupted training, read from its folder or from one of its checkpoints.

use super::config::RunConfig;
use super::folder::{find_checkpoint, run_of_checkpoint};
use super::scale::Scale;
use super::summary::Summary;
use crate::backend::{Backend, RenderOptions};
use crate::bake::{asset_cameras, set_up};
use crate::camera::up::Up;
use crate::capture::Capture;
use crate::cpu::CpuBackend;
use crate::model::{AdamState, Model};
use crate::rounding::Quantisation;
use crate::train::checkpoint;
use crate::verify::{
    CaptureIdentity, PSNR_TEST, bake_checkpoint, cameras_from_strings, metric_from_strings, up_from_strings,
};
use crate::views::ViewSource as _;
use crate::{Error, Report, Result};
use litetex_exporters::{AssetCamera, METRES, Provenance, SplatAsset, UNKNOWN_SCALE};
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
    /// How its numbers are rounded, if it was trained as its file will hold it.
    pub quantisation: Option<Quantisation>,
    /// Which direction of the capture is up.
    pub up: Up,
    /// The program by whose poses a unit of the capture is a metre, if they say so.
    pub metric: Option<String>,
    /// The scale that was measured for the run, if one was.
    pub scale: Option<Scale>,
}

impl Trained {
    /// Loads a checkpoint, or the last one of a run.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::InvalidInput`], [`Error::Unsupported`].
    pub fn load(source: &Path) -> Result<Self> {
        let path = find_checkpoint(source)?;
        let (state, strings) = checkpoint::load_without_history(&path)?;
        let config = config_of(&path, &strings)?;
        let identity = CaptureIdentity::from_strings(&path, &strings)?;
        let cameras = cameras_from_strings(&path, &strings)?;
        let up = up_from_strings(&path, &strings)?;
        let scale = run_of_checkpoint(&path).map_or(Ok(None), |run| Scale::read(&run))?;
        let metric = metric_from_strings(&strings);
        Ok(Self {
            path,
            step: state.step,
            // Of a run that goes on, the numbers are not those of a file.
            quantisation: state
                .rounded
                .filter(|last| last.is_last && last.step == state.step)
                .map(|last| last.steps),
            model: state.model,
            adam: state.adam,
            config,
            identity,
            cameras,
            up,
            metric,
            scale,
        })
    }

    /// The scene without pending updates.
    ///
    /// # Errors
    /// [`Error::Device`] if threads cannot be started.
    pub fn flushed(&self) -> Result<Model> {
        let mut backend = CpuBackend::new(Some(rayon::current_num_threads()))?;
        backend.upload(&self.model, &self.adam)?;
        backend.read_flushed()
    }

    /// How the views of the run are rendered, on its background.
    pub fn render_options(&self) -> RenderOptions {
        render_options(&self.model, self.config.train.background, false)
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
        let capture = Capture::load(path, &self.config.capture)?;
        self.identity.check_frame(&CaptureIdentity::new(&capture, capture.capture_from_local))?;
        Ok(capture)
    }

    /// The scene as an asset; `report` gets what was left out of it.
    ///
    /// # Errors
    /// What the device reports; [`Error::Usage`] for a scene that no asset can hold.
    pub fn bake(&self, backend: &mut dyn Backend, report: &mut Report) -> Result<SplatAsset> {
        let model = (&self.model, &self.adam);
        let background = self.config.train.background;
        let provenance = provenance(&self.config, self.step, self.test_psnr());
        let mut asset =
            bake_checkpoint(backend, model, self.cameras.clone(), background, provenance, report)?;
        set_up(&mut asset, &self.up);
        if let Some(scale) = &self.scale {
            asset.set_scale(scale.metres_per_unit);
        }
        asset.provenance.scale = self.scale_words();
        Ok(asset)
    }

    /// Whether a unit of exports is a metre, and how that is known.
    pub fn scale_words(&self) -> String {
        self.scale.as_ref().map_or_else(|| self.scale_words_unmeasured(), Scale::words)
    }

    /// The same, if no scale had been measured.
    pub fn scale_words_unmeasured(&self) -> String {
        scale_words(self.metric.as_deref())
    }

    /// The test PSNR in the summary of the run, if it belongs to the checkpoint's step.
    fn test_psnr(&self) -> Option<f64> {
        let run = self.path.parent()?.parent()?;
        let summary = Summary::read(&run.join("summary.json")).ok()?;
        (summary.steps == self.step).then_some(summary.quality?.evaluation.psnr)
    }
}

/// What an asset states about its training.
fn provenance(config: &RunConfig, step: u32, test_psnr: Option<f64>) -> Provenance {
    let name = config.data.as_deref().and_then(Path::file_name).unwrap_or_default();
    let name = name.to_string_lossy().into_owned();
    let train = &config.train;
    let mut training = BTreeMap::from([
        ("steps".to_owned(), step.to_string()),
        ("profile".to_owned(), config.profile.name().to_owned()),
        ("policy".to_owned(), train.policy.to_string()),
        ("seed".to_owned(), train.seed.to_string()),
    ]);
    if let Some(psnr) = test_psnr {
        training.insert(PSNR_TEST.to_owned(), format!("{psnr:.3}"));
    }
    Provenance { title: name.clone(), source: name, training, ..Provenance::default() }
}

/// Whether a unit of exports is a metre, by the program whose poses say so.
fn scale_words(metric: Option<&str>) -> String {
    let of_poses = |program| format!("{METRES}: as the poses of {program} are");
    metric.map_or_else(|| UNKNOWN_SCALE.to_owned(), of_poses)
}

/// What the file of a run holds besides splats, as far as it is known before the training.
pub fn file_frame(capture: &Capture, config: &RunConfig) -> SplatAsset {
    let mut frame = SplatAsset {
        cameras: asset_cameras(capture),
        background: config.train.background,
        // As many digits as the figure will have.
        provenance: provenance(config, config.train.last_step(), Some(10.0)),
        ..SplatAsset::default()
    };
    frame.provenance.scale = scale_words(capture.metric());
    set_up(&mut frame, &capture.up());
    frame
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
