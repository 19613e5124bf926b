//! `litetex compare`: two images, two folders of images, or the images of two scenes.

use super::sources::{check_kind, is_asset, load_scene};
use litetex_gs::backend::RenderedImage;
use litetex_gs::capture::{is_image_name, read_image};
use litetex_gs::console::device;
use litetex_gs::console::values::{parse_decibels, whole};
use litetex_gs::console::{Interrupt, Log, Output, columns, path_text};
use litetex_gs::run::find_checkpoint;
use litetex_gs::text::{counted, shortened};
use litetex_gs::verify::{Difference, SceneRenderer, evenly_spread};
use litetex_gs::{Error, Result, input_file, invalid, usage};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Compare two images, two folders of images, or two scenes
///
/// Scenes (runs, checkpoints, assets) are rendered from the cameras of the second. Images of folders are paired by name.
#[derive(clap::Args)]
pub struct CompareArgs {
    /// Image, folder of images, run, checkpoint or asset
    #[arg(value_name = "A")]
    a: PathBuf,
    /// Reference for A, of the same kind
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Fail (exit code 1) if the mean PSNR is below this
    #[arg(long, value_name = "DB", value_parser = parse_decibels)]
    min_psnr: Option<f64>,
    /// Render this many views of scenes, evenly spread [default: all]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1..=u64::MAX))]
    views: Option<u32>,
    /// Where to compute
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Characters of a name that a table shows at most.
const NAME_CHARS: usize = 60;

/// Compares and prints.
pub fn run(args: &CompareArgs, log: &Log) -> Result<Output> {
    for path in [&args.a, &args.b] {
        input_file::check_exists(path)?;
        if !is_image_name(path) {
            check_kind(path, ", an image (.png, .jpg, .exr) or a folder of images")?;
        }
    }
    let differences = match (is_scene(&args.a), is_scene(&args.b)) {
        (true, true) => scenes(args, log)?,
        (false, false) => images(&args.a, &args.b)?,
        _ => {
            return Err(usage!(
                "{} and {}: one is a scene, the other is not",
                args.a.display(),
                args.b.display()
            ));
        }
    };
    let psnr = mean(&differences, Difference::psnr);
    let failure = args
        .min_psnr
        .filter(|least| psnr < *least)
        .map(|least| Error::CheckFailed(format!("PSNR {psnr:.2} dB, expected at least {least} dB")));
    let output = Output::new("litetex-compare/1", as_json(args, &differences), table_of(&differences));
    Ok(output.failing(failure))
}

/// A figure of a difference.
type Figure = fn(&Difference) -> f64;

fn mean(differences: &[Difference], figure: Figure) -> f64 {
    differences.iter().map(figure).sum::<f64>() / differences.len() as f64
}

fn as_json(args: &CompareArgs, differences: &[Difference]) -> Value {
    let of_view = |d: &Difference| {
        json!({ "name": d.quality.name, "psnr": d.psnr(), "grad_psnr": d.quality.grad_psnr,
            "ssim_3dgs": d.quality.ssim_3dgs, "ssim_valid": d.quality.ssim_valid, "flip": d.quality.flip,
            "largest": d.largest })
    };
    json!({
        "a": path_text(&args.a),
        "b": path_text(&args.b),
        "psnr": mean(differences, Difference::psnr),
        "grad_psnr": mean(differences, |d| d.quality.grad_psnr),
        "ssim_3dgs": mean(differences, |d| d.quality.ssim_3dgs),
        "flip": mean(differences, |d| d.quality.flip),
        "per_view": differences.iter().map(of_view).collect::<Vec<_>>(),
    })
}

fn table_of(differences: &[Difference]) -> String {
    let figures: [(&str, usize, Figure); 5] = [
        ("PSNR", 2, Difference::psnr),
        ("grad", 2, |d| d.quality.grad_psnr),
        ("SSIM", 4, |d| d.quality.ssim_3dgs),
        ("FLIP", 4, |d| d.quality.flip),
        ("largest", 6, |d| d.largest.into()),
    ];
    let headings: Vec<&str> = std::iter::once("image").chain(figures.iter().map(|f| f.0)).collect();
    let row = |name: &str, of: &dyn Fn(Figure) -> f64| {
        let cells = figures.iter().map(|&(_, digits, figure)| format!("{:.digits$}", of(figure)));
        std::iter::once(name.to_owned()).chain(cells).collect::<Vec<_>>()
    };
    let of_views =
        differences.iter().map(|d| row(&shortened(&d.quality.name, NAME_CHARS), &|figure| figure(d)));
    let rows: Vec<_> = of_views.chain([row("mean", &|figure| mean(differences, figure))]).collect();
    columns(&headings, &rows)
}

/// Whether a path names a run, a checkpoint or an asset.
fn is_scene(path: &Path) -> bool {
    is_asset(path) || find_checkpoint(path).is_ok()
}

fn scenes(args: &CompareArgs, log: &Log) -> Result<Vec<Difference>> {
    let (a, _) = load_scene(&args.a, log)?;
    let (b, _) = load_scene(&args.b, log)?;
    let cameras = &b.asset.cameras;
    if cameras.is_empty() {
        let what = "has no cameras to render from; give a run, or an asset with cameras, as B";
        return Err(usage!("{}: {what}", args.b.display()));
    }
    let views = evenly_spread(cameras, args.views.map_or(usize::MAX, |v| v as usize));
    let interrupt = Interrupt::current();
    let go_on = || !interrupt.is_requested();
    let mut renderer = SceneRenderer::new(device::open(&args.device, log)?, &go_on);
    let expected = renderer.images(&b.asset, &views)?;
    let mut seen = a.asset.in_frame(&b.asset.capture_from_local);
    if a.asset.cameras.is_empty() {
        // Formats without cameras carry none of these.
        (seen.near, seen.background, seen.filter) = (b.asset.near, b.asset.background, b.asset.filter);
    }
    let found = renderer.images(&seen, &views)?;
    let pairs = views.iter().zip(&found).zip(&expected);
    Ok(pairs.map(|((v, f), e)| Difference::of(&v.name, f, e)).collect())
}

fn images(a: &Path, b: &Path) -> Result<Vec<Difference>> {
    if a.is_dir() != b.is_dir() {
        return Err(usage!("{} and {}: a folder and a file", a.display(), b.display()));
    }
    if !a.is_dir() {
        return Ok(vec![difference(&a.display().to_string(), a, b)?]);
    }
    let [in_a, in_b] = [names(a)?, names(b)?];
    let both: Vec<&PathBuf> = in_a.intersection(&in_b).collect();
    if both.is_empty() {
        return Err(usage!(
            "none of the {1} images in {0} shares a name with any of the {3} in {2}",
            a.display(),
            in_a.len(),
            b.display(),
            in_b.len()
        ));
    }
    let alone = in_a.symmetric_difference(&in_b).count();
    if alone > 0 {
        return Err(usage!(
            "{} in one folder only, the first is {}",
            counted(alone, "image"),
            in_a.symmetric_difference(&in_b).next().map_or(String::new(), |p| p.display().to_string())
        ));
    }
    both.into_iter()
        .map(|name| difference(&name.display().to_string(), &a.join(name), &b.join(name)))
        .collect()
}

fn difference(name: &str, a: &Path, b: &Path) -> Result<Difference> {
    let [found, expected] = [read(a)?, read(b)?];
    if [found.width_px, found.height_px] != [expected.width_px, expected.height_px] {
        return Err(invalid!(
            a,
            "{} x {} pixels, {} has {} x {}",
            found.width_px,
            found.height_px,
            b.display(),
            expected.width_px,
            expected.height_px
        ));
    }
    Ok(Difference::of(name, &found, &expected))
}

fn read(path: &Path) -> Result<RenderedImage> {
    let (width_px, height_px, rgb) = read_image(path)?;
    Ok(RenderedImage { width_px, height_px, rgb, alpha: vec![], depth: vec![], normal: vec![] })
}

/// Paths of the images below a folder, relative to it.
fn names(folder: &Path) -> Result<BTreeSet<PathBuf>> {
    let mut found = BTreeSet::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(&at).map_err(|e| Error::io(&at, e))? {
            let path = entry.map_err(|e| Error::io(&at, e))?.path();
            if path.is_dir() {
                folders.push(path);
            } else if is_image_name(&path)
                && let Ok(name) = path.strip_prefix(folder)
            {
                found.insert(name.to_owned());
            }
        }
    }
    Ok(found)
}
