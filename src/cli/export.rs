//! `litetex export`, also called `convert`: assets from runs and from each other.

use super::asset_args::AssetArgs;
use super::export_files::{listen, write_all};
use super::outputs;
use super::scale_from::{ScaleFrom, measure, parse_scale_from};
use super::sources::{load_layers, say_up};
use litetex_exporters::UNKNOWN_SCALE;
use litetex_gs::Result;
use litetex_gs::camera::up::direction_text;
use litetex_gs::console::values::whole;
use litetex_gs::console::{Log, Output};
use litetex_gs::run::{Scale, Trained, run_of_checkpoint};
use litetex_gs::verify::BakedScene;
use serde_json::json;
use std::path::PathBuf;

/// Write a trained scene as an asset, or an asset in another format
///
/// The extension of each file determines its format. Every file is read back, rendered and compared with the scene before
/// it is moved into place; test PSNR is that of the scene and of the file on the photos held out, if they are still there.
/// "litetex convert" is the same command.
#[derive(clap::Args)]
pub struct ExportArgs {
    /// A run, a checkpoint or an asset
    #[arg(value_name = "RUN|CHECKPOINT|ASSET")]
    source: PathBuf,
    /// Files to write
    #[arg(value_name = "FILE", required_unless_present_any = ["out", "scale_from"])]
    files: Vec<PathBuf>,
    /// File to write; several may follow
    #[arg(long, short, value_name = "FILE", num_args = 1..)]
    out: Vec<PathBuf>,
    /// Keep only the first N layers of a .ltgs file, or one inside glTF, which are a coarser scene; 0: its stand-in
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0..=u64::MAX), help_heading = "Scene")]
    layers: Option<u32>,
    /// Two points and their distance, such as 'A.jpg:10,20 A.jpg:300,40 = 1.2m', by which a unit of the files becomes a metre; kept
    /// beside the run for later exports, "none" forgets it. Points: VIEW:x,y, a pixel of the stored photo, which shows the surface
    /// there; VIEW:x,y+VIEW:x,y, the same point in two views; X,Y,Z, in the capture's frame. Units: mm, cm, m, in, ft
    #[arg(long, value_name = "POINTS", value_parser = parse_scale_from, allow_hyphen_values = true, conflicts_with = "scale", help_heading = "Scene")]
    scale_from: Option<ScaleFrom>,
    #[command(flatten)]
    asset: AssetArgs,
    /// Where to render for the comparison
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Loads, writes and verifies.
pub fn run(args: &ExportArgs, log: &Log) -> Result<Output> {
    listen(log)?;
    let source = args.source.is_file().then_some(args.source.as_path());
    let out = [&*args.files, &args.out].concat();
    outputs::check(source, &out, &args.asset)?;
    let (mut scene, trained) = load_layers(&args.source, args.layers, log)?;
    if let Some(from) = &args.scale_from {
        scale(from, &mut scene, trained.as_ref(), log)?;
    }
    if out.is_empty() {
        let words = scene.asset.provenance.scale_words();
        return Ok(Output::new(
            "litetex-export/1",
            json!({ "files": [], "scale": words }),
            format!("{words}\n"),
        ));
    }
    if let Some(up) = args.asset.up.and_then(|up| up.in_capture) {
        scene.asset.set_up(up);
        scene.asset.provenance.up = format!("{}: requested with --up", direction_text(up));
    }
    say_up(&scene.asset, log);
    Ok(write_all((scene, trained.as_ref()), &out, &args.asset, &args.device, log)?.output())
}

/// Measures the scale of a scene, or forgets it, for this export and, beside a run, for later ones.
fn scale(from: &ScaleFrom, scene: &mut BakedScene, trained: Option<&Trained>, log: &Log) -> Result<()> {
    let run = trained.and_then(|trained| run_of_checkpoint(&trained.path));
    let (factor, words) = match from {
        ScaleFrom::None => {
            let had_one = run.as_deref().map_or(Ok(false), Scale::remove)?;
            log.info(if had_one { "the scale of the run is forgotten" } else { "the run had no scale" });
            let stated = trained.map(Trained::scale_words_unmeasured);
            (1.0, stated.unwrap_or_else(|| UNKNOWN_SCALE.to_owned()))
        }
        ScaleFrom::Distance(points, metres, text) => {
            let found = measure((points, *metres, text), (scene, trained), log)?;
            if let Some(run) = &run {
                found.store(run)?;
                log.info(&format!(
                    "kept in {} for later exports; --scale-from none forgets it",
                    run.display()
                ));
            }
            (found.metres_per_unit, found.words())
        }
    };
    scene.asset.set_scale(factor);
    scene.asset.provenance.scale = words;
    Ok(())
}
