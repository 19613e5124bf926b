//! `litetex-lab figures`: figures of a run's test views beyond those of `litetex eval`.

use super::regions::Regions;
use litetex_gs::console::{Log, Output, Table, device, path_text};
use litetex_gs::eval::{ImagePair, SequenceError};
use litetex_gs::run::Trained;
use litetex_gs::verify::CaptureIdentity;
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

/// Report figures of parts of the test views, or of how they change over time
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("figures").required(true).multiple(true))]
pub struct FiguresArgs {
    /// Folder of a run, or a checkpoint
    #[arg(value_name = "RUN|CHECKPOINT")]
    source: PathBuf,
    /// Capture of the run, if it has been moved
    #[arg(long, value_name = "DIR")]
    capture: Option<PathBuf>,
    /// Figures of the parts of the images that masks in this folder mark white: PSNR, pixels within 10 % of their colour,
    /// and texels per pixel; masks are PNG files named as the photos, and need not exist for all
    #[arg(long, value_name = "DIR", group = "figures")]
    regions: Option<PathBuf>,
    /// Error of the changes between consecutive test views, which are the frames of a video
    #[arg(long, group = "figures")]
    sequence: bool,
    /// Where to compute
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Renders the test views, compares and prints.
pub fn run(args: &FiguresArgs, log: &Log) -> Result<Output> {
    let trained = Trained::load(&args.source)?;
    let capture = trained.open_capture(args.capture.as_deref())?;
    log.report(&capture.report);
    let test = capture.indices(Split::Test);
    if test.is_empty() {
        return Err(Error::Usage(
            "the capture has no test views; train with --test-every to hold some out".to_owned(),
        ));
    }
    trained.identity.check_held_out(&CaptureIdentity::new(&capture, capture.capture_from_local))?;
    let regions = args.regions.as_deref().map(|folder| Regions::of(folder, &capture, &trained.model));
    let mut regions = regions.transpose()?;
    let mut sequence = args.sequence.then(SequenceError::default);
    let mut backend = device::open(&args.device, log)?;
    backend.upload(&trained.model, &trained.adam)?;
    for view in test {
        let image = backend.render(&capture.camera(view), &trained.render_options())?;
        if let Some(regions) = &mut regions {
            regions.add(&capture, view, &image)?;
        }
        if let Some(sequence) = &mut sequence {
            sequence.add(ImagePair::new(&image.rgb, &*capture.target(view)?));
        }
    }
    let mut found = json!({ "checkpoint": path_text(&trained.path), "step": trained.step });
    let mut table = Table::default();
    table.row("checkpoint", trained.path.display());
    if let Some(regions) = &regions {
        found["regions"] = regions.json();
        regions.rows(&mut table);
    }
    if let Some(mean) = sequence.map(|sequence| sequence.mean()) {
        found["sequence"] = json!({ "mean_error_of_changes": mean });
        table
            .row("error of changes between frames", mean.map_or("-".to_owned(), |mean| format!("{mean:.5}")));
    }
    Ok(Output::new("litetex-figures/1", found, table))
}
