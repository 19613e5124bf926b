//! `litetex verify`: renders a file and the scene it was made from, and compares the images.

use super::sources::{load_scene, open_photos, read_limits, read_scene};
use litetex_exporters::{AssetCamera, Format, SplatAsset, Transform, read_fallback};
use litetex_gs::bake::asset_cameras;
use litetex_gs::capture::Capture;
use litetex_gs::console::device;
use litetex_gs::console::values::{parse_decibels, whole};
use litetex_gs::console::{Interrupt, Log, Output, Table, path_text};
use litetex_gs::verify::{
    ExpectedImages, PhotoPsnr, QualityLimits, ReadBack, SceneRenderer, Verdict, evenly_spread, verify,
    views_around,
};
use litetex_gs::views::ViewSource;
use litetex_gs::{Error, Result, usage};
use serde_json::json;
use std::path::PathBuf;

/// Verify that a file renders like the scene it was made from
///
/// Renders both from the views of the scene and compares them. Exit code 1 if the file exceeds the limits of its
/// quality: lossless, no difference at all; balanced, at most 0.02 dB lost on average and 0.05 dB in any view; tiny,
/// 0.10 and 0.25 dB. The loss follows from the differences between the images at the scene's PSNR on test views; PSNR
/// on the photos is printed too, but not checked. Files without textures are compared with the untextured scene.
#[derive(clap::Args)]
pub struct VerifyArgs {
    /// File to verify
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// What it was made from: a run, a checkpoint or another asset
    #[arg(long, value_name = "RUN|CHECKPOINT|ASSET")]
    against: PathBuf,
    /// Also measure the PSNR on the photos of this capture, before and after [default: the run's, if it is there]
    #[arg(long, value_name = "DIR")]
    capture: Option<PathBuf>,
    /// Render this many views, evenly spread [default: all]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1..=u64::MAX))]
    views: Option<u32>,
    /// Allow this much PSNR to be lost on average, such as 0.1dB, instead of the quality's limit
    #[arg(long, value_name = "DB", value_parser = parse_decibels)]
    max_loss: Option<f64>,
    /// Require this PSNR against the scene's images, instead of the quality's limits
    #[arg(long, value_name = "DB", value_parser = parse_decibels)]
    min_psnr: Option<f64>,
    /// Where to compute
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Renders, compares, prints.
pub fn run(args: &VerifyArgs, log: &Log) -> Result<Output> {
    let format = Format::of(&args.file).map_err(Error::from)?;
    let file = read_scene(&args.file, log)?;
    let (scene, trained) = load_scene(&args.against, log)?;
    let Some(contents) = &file.contents else { return Err(usage!("not a file")) };
    let mut limits = QualityLimits::of_file(&args.file, contents);
    if args.max_loss.is_some() || args.min_psnr.is_some() {
        limits = QualityLimits { max_loss_db: args.max_loss, min_psnr: args.min_psnr, ..QualityLimits::NONE };
    }
    let photos = open_photos(&scene, trained.as_ref(), args.capture.as_deref(), log)?;
    let cameras = cameras_of(&scene.asset, photos.as_ref());
    let views = evenly_spread(&cameras, args.views.map_or(usize::MAX, |v| v as usize));
    let interrupt = Interrupt::current();
    let go_on = || !interrupt.is_requested();
    let mut renderer = SceneRenderer::new(device::open(&args.device, log)?, &go_on);
    let fallback = read_fallback(&args.file, &read_limits()).map_err(Error::from)?;
    let read_back =
        ReadBack { asset: &file.asset, textured: format.keeps_textures(), fallback: fallback.as_ref() };
    let expected = ExpectedImages::render(&mut renderer, &scene.asset, &views)?;
    let photos = photos.as_ref().map(|capture| capture as &dyn ViewSource);
    let verdict = verify(&mut renderer, &expected, read_back, photos, limits)?;
    let found = json!({
        "file": path_text(&args.file),
        "format": contents.format,
        "against": path_text(&scene.path),
        "verified": verdict.failures.is_empty(),
        "verdict": verdict,
    });
    let mut table = Table::default();
    table.row("file", format!("{} ({})", args.file.display(), contents.format));
    table.row("against", scene.path.display());
    add_rows(&verdict, &mut table);
    let failure = (!verdict.failures.is_empty())
        .then(|| Error::CheckFailed(format!("{}: {}", args.file.display(), verdict.failures.join("; "))));
    Ok(Output::new("litetex-verify/1", found, table).failing(failure))
}

/// The cameras of a scene, those of its capture if the scene has none, or views around it.
fn cameras_of(scene: &SplatAsset, capture: Option<&Capture>) -> Vec<AssetCamera> {
    if !scene.cameras.is_empty() {
        return scene.cameras.clone();
    }
    let Some(capture) = capture else { return views_around(scene) };
    let of_capture = &capture.capture_from_local;
    let frame = Transform::scaled_and_moved(of_capture.scale, of_capture.translation.to_array());
    let scene_from_local = scene.capture_from_local.inverse().after(&frame);
    asset_cameras(capture).iter().map(|camera| camera.in_frame(&scene_from_local)).collect()
}

/// A verdict as rows of a table.
fn add_rows(v: &Verdict, table: &mut Table) {
    let scene = if v.untextured { "the untextured scene" } else { "the scene" };
    table.row("views", v.views);
    if v.has_other_splats() {
        table.row("splats", format!("{} of the scene's {}", v.splats[0], v.splats[1]));
    }
    table.row("PSNR", format!("{:.2} dB, worst {:.2} dB, against {scene}", v.psnr, v.psnr_worst));
    table.row("SSIM, FLIP", format!("{:.6}, {:.6}", v.ssim, v.flip));
    table.row("largest difference", format!("{:e}", v.largest));
    let what = format!("{:.4} dB at the scene's quality, worst view {:.4} dB", v.loss_db, v.loss_worst_db);
    table.row("lost", what);
    for (name, figures) in [("training photos", v.on_training_photos), ("test photos", v.on_test_photos)] {
        if let Some(PhotoPsnr { before, after, .. }) = figures {
            table.row(name, format!("{before:.3} dB before, {after:.3} dB after (not checked)"));
        }
    }
    let on_photos = v.on_test_photos.or(v.on_training_photos);
    let on_photos = on_photos.map_or_else(String::new, |p| format!(", {:.3} dB on photos", p.fallback));
    table.row("fallback", format!("{:.2} dB in programs without textures{on_photos}", v.fallback_psnr));
    table.row(
        "verified",
        if v.limits == QualityLimits::NONE {
            "this quality has no limits; set them with --max-loss and --min-psnr".to_owned()
        } else if v.failures.is_empty() {
            "yes".to_owned()
        } else {
            format!("no: {}", v.failures.join("; "))
        },
    );
}
