//! `litetex export` and `litetex convert`: assets out of runs and of each other.

use super::asset_args::AssetArgs;
use super::differences::{Stage, spread};
use super::frozen::Frozen;
use super::log::Log;
use super::search;
use super::table::Columns;
use super::values::format_bytes;
use super::verdict::{Expected, Limits, Verdict, judge, limits_of};
use litetex_exporters::{
    AssetCamera, Format, ReadLimits, SplatAsset, WriteOptions, Written, read_asset, write_asset,
};
use litetex_gs::{Error, Result};
use std::path::{Path, PathBuf};

/// Views that are rendered to prove a file right; "litetex verify" renders all.
const PROOF_VIEWS: usize = 8;

/// Write a trained scene as an asset
///
/// The extension of each file decides its format. Every file is read back and rendered to prove that it is right.
#[derive(clap::Args)]
pub struct ExportArgs {
    /// A run, a checkpoint or an asset
    #[arg(value_name = "RUN|CHECKPOINT|ASSET")]
    source: PathBuf,
    /// File to write; several may follow
    #[arg(long, short, value_name = "FILE", num_args = 1.., required = true)]
    out: Vec<PathBuf>,
    #[command(flatten)]
    asset: AssetArgs,
    /// Where to render for the proof
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Write an asset in another format
///
/// As "litetex export ASSET -o FILE".
#[derive(clap::Args)]
pub struct ConvertArgs {
    /// The asset
    #[arg(value_name = "IN")]
    source: PathBuf,
    /// File to write
    #[arg(value_name = "OUT")]
    out: PathBuf,
    #[command(flatten)]
    asset: AssetArgs,
    /// Where to render for the proof
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Exports.
pub fn run(args: &ExportArgs, log: &Log) -> anyhow::Result<()> {
    check_outputs(&args.out, &args.asset)?;
    let frozen = Frozen::load(&args.source, log)?;
    Ok(print(&write_all(frozen, &args.out, &args.asset, &args.device, log)?)?)
}

/// Converts.
pub fn convert(args: &ConvertArgs, log: &Log) -> anyhow::Result<()> {
    let outputs = [args.out.clone()];
    check_outputs(&outputs, &args.asset)?;
    Format::of(&args.source).map_err(Error::from)?;
    let frozen = Frozen::read(&args.source, log)?;
    Ok(print(&write_all(frozen, &outputs, &args.asset, &args.device, log)?)?)
}

/// A file that was written, with its proof.
pub struct Exported {
    path: PathBuf,
    written: Written,
    /// Size of the scene's numbers as f32.
    raw_bytes: u64,
    verdict: Option<Verdict>,
}

/// Refuses what cannot be written before anything is done.
///
/// # Errors
/// [`Error::Unsupported`] for unknown extensions and qualities, [`Error::Usage`] for files that exist or are named twice.
pub fn check_outputs(outputs: &[PathBuf], args: &AssetArgs) -> Result<()> {
    let is_ltgs = |path: &PathBuf| Format::from_path(path) == Some(Format::Ltgs);
    if args.asked_limits().is_some() && !outputs.iter().any(is_ltgs) {
        return Err(Error::Usage("--max-size and --max-loss shape .ltgs files, and none is written".into()));
    }
    for (i, path) in outputs.iter().enumerate() {
        let format = Format::of(path)?;
        format.check_quality(args.quality(), path)?;
        if outputs[..i].contains(path) {
            return Err(Error::Usage(format!("{}: named twice", path.display())));
        }
        if path.is_dir() {
            return Err(Error::Usage(format!(
                "{}: is a folder, expected the name of a file",
                path.display()
            )));
        }
        if path.exists() && !args.force {
            return Err(Error::Usage(format!("{}: exists; --force replaces it", path.display())));
        }
    }
    Ok(())
}

/// Edits the scene, writes every file, proves each.
///
/// # Errors
/// What writing, reading back or rendering report. A file that is not right stays, and the error says so: exit code 1.
pub fn write_all(
    mut frozen: Frozen,
    outputs: &[PathBuf],
    args: &AssetArgs,
    device: &str,
    log: &Log,
) -> Result<Vec<Exported>> {
    args.edit(&mut frozen, log)?;
    frozen.asset.validate().map_err(|e| Error::from(e.at(&frozen.path)))?;
    let views = proof_views(&frozen.asset);
    let mut proof = None;
    if args.no_verify {
        log.detail("the files are not verified");
    } else if views.is_empty() {
        log.warn("not-verified", "the scene has no cameras: the files cannot be proven by rendering", 1);
    } else {
        let mut stage = Stage::open(device, log)?;
        let expected = Expected::of(&mut stage, &frozen.asset, &views)?;
        proof = Some((stage, expected));
    }
    let mut done = Vec::new();
    for path in outputs {
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        }
        let format = Format::of(path)?;
        let (quality, steps) = match format {
            Format::Ltgs => search::steps(&frozen, args, device, log)?,
            _ => (args.quality(), None),
        };
        let options = WriteOptions { quality, mesh: args.mesh, steps };
        let written = write_asset(path, &frozen.asset, &options)?;
        for note in &written.notes {
            log.warn("export", &format!("{}: {note}", path.display()), 1);
        }
        let asked = args.asked_limits().filter(|_| format == Format::Ltgs);
        let verdict =
            proof.as_mut().map(|(stage, expected)| prove(stage, expected, path, asked)).transpose()?;
        done.push(Exported { path: path.clone(), written, raw_bytes: raw_bytes(&frozen.asset), verdict });
    }
    Ok(done)
}

/// Reads a file back and compares its pictures with the scene's.
fn prove(stage: &mut Stage, expected: &Expected<'_>, path: &Path, asked: Option<Limits>) -> Result<Verdict> {
    let contents = read_asset(path, &ReadLimits::default())?;
    let limits = asked.unwrap_or_else(|| limits_of(path, &contents));
    let textured = Format::of(path)?.keeps_textures();
    judge(stage, expected, (&contents.asset, textured), None, limits)
}

/// Training views, evenly spread.
fn proof_views(asset: &SplatAsset) -> Vec<AssetCamera> {
    let training: Vec<_> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
    spread(&training, PROOF_VIEWS)
}

/// Bytes of the numbers of a scene as f32 and u16.
fn raw_bytes(asset: &SplatAsset) -> u64 {
    let per_splat = 4 * (3 + 4 + 2 + 1 + 1) + 4;
    (asset.num_splats() * per_splat + 4 * (asset.sh.len() + asset.texels.len())) as u64
}

/// Prints a row for each file.
///
/// # Errors
/// [`Error::CheckFailed`] if a file is not right.
pub fn print(files: &[Exported]) -> Result<()> {
    let mut table = Columns::new(&["file", "size", "ratio", "PSNR to scene", "lost", "verified"]);
    let mut failures = Vec::new();
    for file in files {
        let verdict = file.verdict.as_ref();
        let told = |of: &dyn Fn(&Verdict) -> String| verdict.map_or_else(|| "-".to_owned(), of);
        let untextured = verdict.is_some_and(|v| v.untextured);
        let lost =
            |v: &Verdict| if v.untextured { "textures".to_owned() } else { format!("{:.3} dB", v.loss_db) };
        table.row(vec![
            file.path.display().to_string(),
            format_bytes(file.written.bytes),
            format!("{:.1}", file.raw_bytes as f64 / file.written.bytes.max(1) as f64),
            told(&|v| {
                if v.largest == 0.0 {
                    "same".to_owned()
                } else {
                    format!("{:.1} dB{}", v.psnr, if untextured { " *" } else { "" })
                }
            }),
            told(&lost),
            told(&|v| if v.failures.is_empty() { "yes".to_owned() } else { "NO".to_owned() }),
        ]);
        failures.extend(
            verdict.iter().flat_map(|v| &v.failures).map(|f| format!("{}: {f}", file.path.display())),
        );
    }
    table.print().map_err(|e| Error::io("standard output", e))?;
    if files.iter().any(|f| f.verdict.as_ref().is_some_and(|v| v.untextured)) {
        println!(
            "* against the scene without textures: this format has none, maps are averaged into the colours"
        );
    }
    if failures.is_empty() { Ok(()) } else { Err(Error::CheckFailed(failures.join("; "))) }
}
