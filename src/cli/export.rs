//! `litetex export` and `litetex convert`: assets out of runs and of each other.

use super::asset_args::AssetArgs;
use super::differences::{Stage, VIEWS, spread};
use super::frozen::{Frozen, read_limits};
use super::interrupt::Interrupt;
use super::log::Log;
use super::outputs;
use super::search::{self, Rounding};
use super::table::Columns;
use super::values::format_bytes;
use super::verdict::{Expected, Found, Limits, Verdict, judge, limits_of};
use litetex_exporters::{
    AssetCamera, Format, SplatAsset, WriteOptions, Written, read_asset, read_fallback, stage_asset,
};
use litetex_gs::{Error, Result};
use std::path::{Path, PathBuf};

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
    let source = args.source.is_file().then_some(args.source.as_path());
    outputs::check(source, &args.out, &args.asset)?;
    let frozen = Frozen::load(&args.source, log)?;
    Ok(write_all(frozen, &args.out, &args.asset, &args.device, log)?.print()?)
}

/// Converts.
pub fn convert(args: &ConvertArgs, log: &Log) -> anyhow::Result<()> {
    let out = [args.out.clone()];
    outputs::check(Some(&args.source), &out, &args.asset)?;
    Format::of(&args.source).map_err(Error::from)?;
    let frozen = Frozen::read(&args.source, log)?;
    Ok(write_all(frozen, &out, &args.asset, &args.device, log)?.print()?)
}

/// What was written, in order, and what stopped it if something did.
#[must_use]
pub struct Exports {
    files: Vec<Exported>,
    stopped: Option<Error>,
}

/// A file with its proof; it is at its place if it is right.
struct Exported {
    path: PathBuf,
    written: Written,
    /// Size of the scene's numbers as f32.
    raw_bytes: u64,
    verdict: Option<Verdict>,
}

/// Edits the scene; writes every file, proves it, and puts it at its place if it is right.
///
/// # Errors
/// If nothing can be written or rendered. What is wrong with one file is told by [`Exports::print`].
pub fn write_all(
    mut frozen: Frozen,
    outputs: &[PathBuf],
    args: &AssetArgs,
    device: &str,
    log: &Log,
) -> Result<Exports> {
    // Staged files must not stay behind.
    let interrupt = Interrupt::listen()?;
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
    let mut exports = Exports { files: Vec::new(), stopped: None };
    for path in outputs {
        let next =
            interrupt.check().and_then(|()| write_one(&frozen, path, args, proof.as_mut(), device, log));
        match next {
            Ok(exported) => exports.files.push(exported),
            Err(error) => {
                exports.stopped = Some(error);
                break;
            }
        }
    }
    Ok(exports)
}

fn write_one(
    frozen: &Frozen,
    path: &Path,
    args: &AssetArgs,
    proof: Option<&mut (Stage, Expected<'_>)>,
    device: &str,
    log: &Log,
) -> Result<Exported> {
    let format = Format::of(path)?;
    let rounding = match format {
        Format::Ltgs => search::rounding(frozen, args, device, log)?,
        _ => Rounding { quality: args.quality(), steps: None, exponents: Vec::new() },
    };
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    let Rounding { quality, steps, exponents } = rounding;
    let options = WriteOptions { quality, mesh: args.mesh, steps, exponents: &exponents };
    let staged = stage_asset(path, &frozen.asset, &options)?;
    for note in &staged.written().notes {
        log.warn("export", &format!("{}: {note}", path.display()), 1);
    }
    let asked = args.asked_limits().filter(|_| format == Format::Ltgs);
    let prove = |(stage, expected): &mut (Stage, Expected<'_>)| prove(stage, expected, &staged.path(), asked);
    let verdict = proof.map(prove).transpose()?;
    // What is not right replaces nothing.
    let is_right = verdict.as_ref().is_none_or(|v| v.failures.is_empty());
    let written = if is_right { staged.publish(args.force)? } else { staged.written().clone() };
    Ok(Exported { path: path.to_owned(), written, raw_bytes: raw_bytes(&frozen.asset), verdict })
}

/// Reads a file back and compares its images with the scene's.
fn prove(stage: &mut Stage, expected: &Expected<'_>, path: &Path, asked: Option<Limits>) -> Result<Verdict> {
    let contents = read_asset(path, &read_limits())?;
    let limits = asked.unwrap_or_else(|| limits_of(path, &contents));
    let fallback = read_fallback(path, &read_limits())?;
    let textured = Format::of(path)?.keeps_textures();
    let found = Found { asset: &contents.asset, textured, fallback: fallback.as_ref() };
    judge(stage, expected, found, None, limits)
}

/// Training views, evenly spread.
fn proof_views(asset: &SplatAsset) -> Vec<AssetCamera> {
    let training: Vec<_> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
    spread(&training, VIEWS)
}

/// Bytes of the numbers of a scene as f32 and u16.
fn raw_bytes(asset: &SplatAsset) -> u64 {
    let per_splat = 4 * (3 + 4 + 2 + 1 + 1) + 4;
    (asset.num_splats() * per_splat + 4 * (asset.sh.len() + asset.texels.len())) as u64
}

impl Exports {
    /// Prints a row for each file.
    ///
    /// # Errors
    /// What stopped the writing, else [`Error::CheckFailed`] if a file is not right.
    pub fn print(self) -> Result<()> {
        let mut table = Columns::new(&["file", "size", "ratio", "PSNR to scene", "lost", "verified"]);
        for file in &self.files {
            table.row(file.row());
        }
        if !self.files.is_empty() {
            table.print().map_err(|e| Error::io("standard output", e))?;
        }
        if self.files.iter().any(|f| f.verdict.as_ref().is_some_and(|v| v.untextured)) {
            println!(
                "* against the scene without textures: this format has none, maps are averaged into the colours"
            );
        }
        if let Some(error) = self.stopped {
            return Err(error);
        }
        let failures: Vec<String> = self.files.iter().flat_map(Exported::failures).collect();
        if failures.is_empty() { Ok(()) } else { Err(Error::CheckFailed(failures.join("; "))) }
    }
}

impl Exported {
    fn failures(&self) -> impl Iterator<Item = String> {
        let all = self.verdict.iter().flat_map(|v| &v.failures);
        all.map(|f| format!("{}: not written, for it is not right: {f}", self.path.display()))
    }

    fn row(&self) -> Vec<String> {
        let told = |of: &dyn Fn(&Verdict) -> String| self.verdict.as_ref().map_or_else(|| "-".to_owned(), of);
        vec![
            self.path.display().to_string(),
            format_bytes(self.written.bytes),
            format!("{:.1}", self.raw_bytes as f64 / self.written.bytes.max(1) as f64),
            told(&|v| match v.largest {
                0.0 => "same".to_owned(),
                _ => format!("{:.1} dB{}", v.psnr, if v.untextured { " *" } else { "" }),
            }),
            told(&|v| if v.untextured { "textures".to_owned() } else { format!("{:.3} dB", v.loss_db) }),
            told(&|v| if v.failures.is_empty() { "yes".to_owned() } else { "NO".to_owned() }),
        ]
    }
}
