//! `litetex sample`: writes a synthetic capture.

use super::log::Log;
use super::run_folder::check_empty;
use super::table::Table;
use super::values::parse_whole;
use litetex_gs::sample::{SampleOptions, write_sample};
use std::path::PathBuf;

/// Generate a small synthetic capture for trying things out
///
/// A ray-cast still life with rich texture in COLMAP layout: photos, exact poses, sparse points and ground-truth depths.
/// Equal options give equal bytes.
#[derive(clap::Args)]
pub struct SampleArgs {
    /// Folder to write into; must be empty
    dir: PathBuf,
    /// Number of photos
    #[arg(long, value_name = "N", value_parser = parse_whole::<usize>, default_value_t = SampleOptions::default().views)]
    views: usize,
    /// Width and height of the photos
    #[arg(long, value_name = "WxH", value_parser = super::values::parse_image_size, default_value = "320x240")]
    size: super::values::ImageSize,
    /// Number of sparse points
    #[arg(long, value_name = "N", value_parser = parse_whole::<usize>, default_value_t = SampleOptions::default().points)]
    points: usize,
    /// Seed of patterns, placement and points
    #[arg(long, value_name = "N", value_parser = parse_whole::<u64>, default_value_t = 0)]
    seed: u64,
    /// Also write the sparse model as text
    #[arg(long)]
    text: bool,
    /// Omit the ground-truth depths and the description of the scene
    #[arg(long)]
    no_truth: bool,
}

/// Writes the capture and prints its figures.
pub fn run(args: &SampleArgs, log: &Log) -> anyhow::Result<()> {
    use super::values::ImageSize;
    let (width_px, height_px) = match args.size {
        ImageSize::Exact(w, h) => (w, h),
        ImageSize::Longer(w) => (w, (w * 3 / 4).max(1)),
    };
    check_empty(&args.dir)?;
    let options = SampleOptions {
        views: args.views,
        width_px,
        height_px,
        seed: args.seed,
        points: args.points,
        text: args.text,
        truth: !args.no_truth,
        ..SampleOptions::default()
    };
    log.info(&format!("ray-casting {} photos of {width_px} x {height_px}", options.views));
    let made = write_sample(&args.dir, &options)?;
    let mut table = Table::default();
    table.row("capture", args.dir.display());
    table.row("photos", made.views);
    table.row("points", made.points);
    table.row("observations", made.observations);
    table.row("mean reprojection error", format!("{:.2} px", made.mean_reprojection_error_px));
    Ok(table.print()?)
}
