//! `litetex verify`: reads a file back and renders it beside the scene that it was made from.

use super::capture::{self, Capture};
use super::differences::{Stage, spread};
use super::frozen::{Frozen, Origin, read_limits};
use super::log::Log;
use super::table::{Table, print_json};
use super::values::parse_decibels;
use super::verdict::{Expected, Found, Limits, judge, limits_of};
use litetex_exporters::{AssetCamera, Format, SplatAsset, Transform, read_fallback};
use litetex_gs::bake::asset_cameras;
use litetex_gs::{Error, Result};
use std::path::{Path, PathBuf};

/// Prove that a file renders as the scene it was made from
///
/// Renders both on the views of the scene and compares. Exit code 1 if the file does not keep what its quality promises:
/// lossless no difference at all; balanced at most 0.02 dB lost on average, 0.05 dB in any view; tiny 0.10 and 0.25 dB.
/// What is lost follows from the images' differences at the scene's PSNR on test views; photos are also told of.
/// Files without textures are compared with the scene without its textures.
#[derive(clap::Args)]
pub struct VerifyArgs {
    /// The file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// What it was made from: a run, a checkpoint or another asset
    #[arg(long, value_name = "RUN|CHECKPOINT|ASSET")]
    against: PathBuf,
    /// The capture: also measures the PSNR on its photos, before and after [default: that of the run, if it is there]
    #[arg(long, value_name = "DIR")]
    capture: Option<PathBuf>,
    /// Render this many views, evenly spread [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    views: Option<u32>,
    /// Most PSNR that may be lost on average, such as 0.1dB, instead of what the quality promises
    #[arg(long, value_name = "DB", value_parser = parse_decibels)]
    max_loss: Option<f64>,
    /// Least PSNR against the scene's images, instead of what the quality promises
    #[arg(long, value_name = "DB", value_parser = parse_decibels)]
    min_psnr: Option<f64>,
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Where to compute
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Renders, compares, prints.
pub fn run(args: &VerifyArgs, log: &Log) -> anyhow::Result<()> {
    let format = Format::of(&args.file).map_err(Error::from)?;
    let found = Frozen::read(&args.file, log)?;
    let against = Frozen::load(&args.against, log)?;
    let Origin::File(contents) = &found.origin else { return Err(Error::Usage("not a file".into()).into()) };
    let mut limits = limits_of(&args.file, contents);
    if args.max_loss.is_some() || args.min_psnr.is_some() {
        limits = Limits { max_loss_db: args.max_loss, min_psnr: args.min_psnr, ..Limits::NONE };
    }
    let capture = photos(&against, args.capture.as_deref(), log)?;
    let cameras = cameras_of(&against.asset, capture.as_ref());
    let views = spread(&cameras, args.views.map_or(usize::MAX, |v| v as usize));
    let mut stage = Stage::open(&args.device, log)?;
    let textured = format.keeps_textures();
    let fallback = read_fallback(&args.file, &read_limits()).map_err(Error::from)?;
    let asset = Found { asset: &found.asset, textured, fallback: fallback.as_ref() };
    let expected = Expected::of(&mut stage, &against.asset, &views)?;
    let verdict = judge(&mut stage, &expected, asset, capture.as_ref(), limits)?;
    if args.json {
        print_json(&serde_json::json!({
            "schema": "litetex-verify/1",
            "file": args.file,
            "format": contents.format,
            "against": against.path,
            "verified": verdict.failures.is_empty(),
            "verdict": verdict,
        }))?;
    } else {
        let mut table = Table::default();
        table.row("file", format!("{} ({})", args.file.display(), contents.format));
        table.row("against", against.path.display());
        verdict.tell(&mut table);
        table.print()?;
    }
    if verdict.failures.is_empty() {
        return Ok(());
    }
    Err(Error::CheckFailed(format!("{}: {}", args.file.display(), verdict.failures.join("; "))).into())
}

/// The photos of a scene: of the folder that is named, else of the run's own, if it is still there.
///
/// # Errors
/// What the loader found in the folder that is named.
pub fn photos(scene: &Frozen, named: Option<&Path>, log: &Log) -> Result<Option<Capture>> {
    let capture = match (scene.trained(), named) {
        (Some(trained), _) if named.is_some() || trained.config.data().is_ok_and(Path::is_dir) => {
            trained.open_capture(named)?
        }
        (None, Some(folder)) => capture::open(folder, &options_of(scene))?,
        _ => return Ok(None),
    };
    log.report(&capture.report);
    Ok(Some(capture))
}

/// The cameras of a scene; of its capture, where it has none itself.
fn cameras_of(scene: &SplatAsset, capture: Option<&Capture>) -> Vec<AssetCamera> {
    let Some(capture) = capture.filter(|_| scene.cameras.is_empty()) else { return scene.cameras.clone() };
    let of_capture = &capture.capture_from_local;
    let frame = Transform::scaled_and_moved(of_capture.scale, of_capture.translation.to_array());
    let scene_from_local = scene.capture_from_local.inverse().after(&frame);
    asset_cameras(capture).iter().map(|camera| camera.in_frame(&scene_from_local)).collect()
}

/// How the capture of an asset is read: its cameras tell the size of the images.
fn options_of(scene: &Frozen) -> capture::LoadOptions {
    let longer = scene.asset.cameras.iter().map(|c| c.width_px.max(c.height_px)).max();
    let mut options = capture::LoadOptions { background: scene.asset.background, ..Default::default() };
    if let Some(longer) = longer {
        options.max_resolution = longer;
    }
    options
}
