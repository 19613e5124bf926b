//! `litetex eval`: quality figures of a trained scene on its test views.

use super::capture_args::set;
use super::sources::on_device;
use super::uncovered::UncoveredArea;
use super::worst_view;
use litetex_gs::backend::{Backend, RenderedImage};
use litetex_gs::capture::Capture;
use litetex_gs::console::values::whole;
use litetex_gs::console::{Log, Output, Table, check_free, path_text};
use litetex_gs::eval::{Evaluation, ImagePair, psnr};
use litetex_gs::run::{MAX_RESOLUTION_MIN, TestFigures, Trained, check_empty, write_per_view, write_view};
use litetex_gs::train::{self, Control, Evaluated};
use litetex_gs::verify::CaptureIdentity;
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result, usage};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Evaluate a run on its test views
///
/// Renders the test views from the last checkpoint of a run, or from a given one, and compares them with the photos.
#[derive(clap::Args)]
pub struct EvalArgs {
    /// Folder of a run, or a checkpoint
    #[arg(value_name = "RUN|CHECKPOINT")]
    source: PathBuf,
    /// Capture of the run, if it has been moved
    #[arg(long, value_name = "DIR")]
    capture: Option<PathBuf>,
    /// Compare with photos of this longer side at most, pixels, such as the full size after a training on smaller ones [default: as
    /// the run was trained]
    #[arg(long, value_name = "PX", value_parser = whole::<u32>(u64::from(MAX_RESOLUTION_MIN)..=65_536))]
    max_resolution: Option<u32>,
    /// Also write images, error maps and per_view.csv into this empty folder
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also report the PSNR within the pixels that this other run of the same capture leaves uncovered (alpha below 0.5)
    #[arg(long, value_name = "RUN")]
    uncovered_by: Option<PathBuf>,
    /// Also report the PSNR of the training views, or only that if the capture has no test views
    #[arg(long)]
    training: bool,
    /// Also write the render of the worst test view beside its photo into this file, JPEG or PNG by its extension
    #[arg(long, value_name = "FILE")]
    worst: Option<PathBuf>,
    /// Replace the file of --worst
    #[arg(long, requires = "worst")]
    force: bool,
    /// Where to compute
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Evaluates and prints.
pub fn run(args: &EvalArgs, log: &Log) -> Result<Output> {
    if let Some(out) = &args.out {
        check_empty(out)?;
    }
    if let Some(worst) = &args.worst {
        worst_view::check(worst)?;
        check_free(std::slice::from_ref(worst), args.force)?;
    }
    let mut trained = Trained::load(&args.source)?;
    set(&mut trained.config.capture.max_resolution, args.max_resolution);
    let capture = trained.open_capture(args.capture.as_deref())?;
    log.report(&capture.report);
    let background = trained.config.train.background;
    let area = args
        .uncovered_by
        .as_deref()
        .map(|other| UncoveredArea::of(&Trained::load(other)?, &capture, background, &args.device, log));
    let mut area = area.transpose()?;
    let mut backend = on_device(&trained, &args.device, log)?;
    let evaluation = match args.needs_test_views() || !capture.indices(Split::Test).is_empty() {
        true => Some(evaluate(&trained, backend.as_mut(), &capture, args.out.as_deref(), area.as_mut())?),
        false => None,
    };
    if let (Some(path), Some(evaluation)) = (&args.worst, &evaluation) {
        let options = trained.render_options();
        worst_view::write(path, backend.as_mut(), &capture, evaluation, &options)?;
    }
    let [width_px, height_px] = largest_px(&capture);
    let mut found = json!({
        "checkpoint": path_text(&trained.path),
        "step": trained.step,
        "resample": "area",
        "width_px": width_px,
        "height_px": height_px,
        "quality": evaluation.as_ref().map(TestFigures::from),
    });
    let mut table = Table::default();
    table.row("checkpoint", trained.path.display());
    table.row("image size", format!("{width_px} x {height_px} px"));
    if let Some(evaluation) = &evaluation {
        add_rows(&mut table, evaluation);
    }
    if let Some(area) = &area {
        found["uncovered_by"] = area.json();
        area.row(&mut table);
    }
    if args.training {
        let psnr = psnr_of_training_views(&trained, backend.as_mut(), &capture)?;
        found["training"] = json!({ "psnr": psnr });
        table.row("PSNR of the training views", psnr.map_or("-".to_owned(), |psnr| format!("{psnr:.2} dB")));
    }
    Ok(Output::new("litetex-eval/2", found, table))
}

impl EvalArgs {
    /// Whether something is asked for besides the figures of the training views.
    fn needs_test_views(&self) -> bool {
        !self.training || [&self.out, &self.uncovered_by, &self.worst].into_iter().any(Option::is_some)
    }
}

/// Width and height of the largest view.
fn largest_px(capture: &Capture) -> [u32; 2] {
    let sizes = (0..capture.num_views()).map(|view| capture.camera(view).pinhole);
    let largest = sizes.max_by_key(|size| size.num_pixels());
    largest.map_or([0; 2], |size| [size.width_px, size.height_px])
}

fn add_rows(table: &mut Table, evaluation: &Evaluation) {
    table.row("test views", evaluation.per_view.len());
    table.row("PSNR", format!("{:.2} dB", evaluation.psnr));
    table.row("gradient-PSNR", format!("{:.2} dB", evaluation.grad_psnr));
    table.row("SSIM (3DGS / valid)", format!("{:.4} / {:.4}", evaluation.ssim_3dgs, evaluation.ssim_valid));
    table.row("FLIP", format!("{:.4}", evaluation.flip));
    if let Some(psnr) = evaluation.psnr_corrected {
        table.row("PSNR, colours corrected", format!("{psnr:.2} dB (right halves)"));
    }
    if let Some(share) = evaluation.uncovered {
        table.row("uncovered pixels", format!("{:.2} %", 100.0 * share));
    }
}

fn evaluate(
    trained: &Trained,
    backend: &mut dyn Backend,
    capture: &Capture,
    out: Option<&Path>,
    mut area: Option<&mut UncoveredArea>,
) -> Result<Evaluation> {
    let views = capture.indices(Split::Test);
    if views.is_empty() {
        return Err(usage!("the capture has no test views; train with --test-every to hold some out"));
    }
    trained.identity.check_held_out(&CaptureIdentity::new(capture, capture.capture_from_local))?;
    if let Some(out) = out {
        std::fs::create_dir_all(out).map_err(|e| Error::io(out, e))?;
    }
    let options = trained.render_options();
    let mut on_view = |view: usize, image: &RenderedImage| -> Result<Control> {
        if let Some(out) = out {
            write_view(out, capture, view, image)?;
        }
        if let Some(area) = &mut area {
            area.add(capture, view, image)?;
        }
        Ok(Control::Continue)
    };
    let Evaluated::Figures(evaluation) = train::evaluate(backend, capture, &views, &options, &mut on_view)?
    else {
        return Err(usage!("the masks exclude every pixel of every test view; check them"));
    };
    if let Some(out) = out {
        write_per_view(out, &evaluation)?;
    }
    Ok(evaluation)
}

/// Mean PSNR of the training views, dB; `None` if there are none.
fn psnr_of_training_views(
    trained: &Trained,
    backend: &mut dyn Backend,
    capture: &Capture,
) -> Result<Option<f64>> {
    let (options, views) = (trained.render_options(), capture.indices(Split::Train));
    let mut sum = 0.0;
    for &view in &views {
        let image = backend.render(&capture.camera(view), &options)?;
        sum += psnr(&ImagePair::new(&image.rgb, &*capture.target(view)?));
    }
    Ok((!views.is_empty()).then(|| sum / views.len() as f64))
}
