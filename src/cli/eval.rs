//! `litetex eval`: quality figures of a trained scene on its held-out views.

use super::capture::{self, Capture};
use super::config_file::RunConfig;
use super::devices;
use super::identity::{self, Identity};
use super::log::Log;
use super::run_folder::find_checkpoint;
use super::session::{write_per_view, write_view};
use super::table::{Table, print_json};
use litetex_exporters::AssetCamera;
use litetex_gs::backend::{Backend, RenderOptions, RenderedImage};
use litetex_gs::eval::Evaluation;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::train::{self, Control, Evaluated, checkpoint};
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Evaluate a run on its test views
///
/// Renders the held-out views from the last checkpoint of a run, or from a given one, and compares them
/// with the photos.
#[derive(clap::Args)]
pub struct EvalArgs {
    /// Folder of a run, or a checkpoint
    #[arg(value_name = "RUN|CHECKPOINT")]
    source: PathBuf,
    /// The capture, if it is no longer where it was
    #[arg(long, value_name = "DIR")]
    capture: Option<PathBuf>,
    /// Also write images, error maps and per_view.csv into this empty folder
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// All figures, of each view too, as JSON
    #[arg(long)]
    json: bool,
    /// Where to compute
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// A trained scene with what it was trained from.
pub struct Trained {
    /// The checkpoint.
    pub path: PathBuf,
    /// Steps done.
    pub step: u32,
    /// The scene.
    pub model: Model,
    /// The optimiser: lazily updated parameters are flushed with it.
    pub adam: AdamState,
    /// Settings of the run.
    pub config: RunConfig,
    /// Views of the run; older checkpoints do not tell.
    identity: Option<Identity>,
    /// Cameras of the run; older checkpoints have none.
    pub cameras: Option<Vec<AssetCamera>>,
}

impl Trained {
    /// Loads the checkpoint that a path means.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn load(source: &Path) -> Result<Self> {
        let path = find_checkpoint(source)?;
        let (state, strings) = checkpoint::load_without_history(&path)?;
        let config = config_of(&path, &strings)?;
        let identity = Identity::from_strings(&path, &strings)?;
        let cameras = identity::cameras(&path, &strings)?;
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

    /// The capture that it was trained from, at its place or another.
    ///
    /// # Errors
    /// What the loader found; [`Error::Usage`] if it is another capture.
    pub fn open_capture(&self, elsewhere: Option<&Path>) -> Result<Capture> {
        let path = match elsewhere {
            Some(path) => path,
            None => self.config.data()?,
        };
        let capture = capture::open(path, &self.config.capture)?;
        if let Some(identity) = &self.identity {
            identity.check_frame(&Identity::of(&capture))?;
        }
        Ok(capture)
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

/// How a scene is rendered.
pub fn render_options(model: &Model, background: [f32; 3], geometry: bool) -> RenderOptions {
    RenderOptions { background, sh_degree: model.splats.sh_degree, geometry }
}

/// Evaluates and prints.
pub fn run(args: &EvalArgs, log: &Log) -> anyhow::Result<()> {
    if let Some(out) = &args.out {
        super::run_folder::RunFolder::check_free(out, false)?;
    }
    let trained = Trained::load(&args.source)?;
    let capture = trained.open_capture(args.capture.as_deref())?;
    log.report(&capture.report);
    let mut backend = trained.on_device(&args.device, log)?;
    let evaluation = evaluate(&trained, backend.as_mut(), &capture, args.out.as_deref())?;
    if args.json {
        return Ok(print_json(&serde_json::json!({
            "schema": "litetex-eval/1",
            "checkpoint": trained.path,
            "step": trained.step,
            "resample": "area",
            "quality": super::summary::Quality::from(&evaluation),
        }))?);
    }
    let mut table = Table::default();
    table.row("checkpoint", trained.path.display());
    table.row("test views", evaluation.per_view.len());
    table.row("PSNR", format!("{:.2} dB", evaluation.psnr));
    table.row("gradient-PSNR", format!("{:.2} dB", evaluation.grad_psnr));
    table.row("SSIM (3DGS / valid)", format!("{:.4} / {:.4}", evaluation.ssim_3dgs, evaluation.ssim_valid));
    table.row("FLIP", format!("{:.4}", evaluation.flip));
    Ok(table.print()?)
}

fn evaluate(
    trained: &Trained,
    backend: &mut dyn Backend,
    capture: &Capture,
    out: Option<&Path>,
) -> Result<Evaluation> {
    let views = capture.indices(Split::Test);
    if views.is_empty() {
        return Err(Error::Usage("the capture has no test views: see --test-every of train".to_owned()));
    }
    if let Some(identity) = &trained.identity {
        identity.check_held_out(&Identity::of(capture))?;
    }
    if let Some(out) = out {
        std::fs::create_dir_all(out).map_err(|e| Error::io(out, e))?;
    }
    let options = render_options(&trained.model, trained.config.train.background, false);
    let mut on_view = |view: usize, image: &RenderedImage| -> Result<Control> {
        if let Some(out) = out {
            write_view(out, capture, view, image)?;
        }
        Ok(Control::Continue)
    };
    let Evaluated::Figures(evaluation) = train::evaluate(backend, capture, &views, &options, &mut on_view)?
    else {
        return Err(Error::Usage("no test view has a pixel that counts: look at its masks".to_owned()));
    };
    if let Some(out) = out {
        write_per_view(&out.join("per_view.csv"), &evaluation)?;
    }
    Ok(evaluation)
}
