//! `litetex sample`: writes a synthetic capture.

use litetex_gs::Result;
use litetex_gs::console::values::{ImageSize, parse_image_size, parse_whole};
use litetex_gs::console::{Log, Output, Table, path_text};
use litetex_gs::run::check_empty;
use litetex_gs::sample::{NamedScene, SampleOptions, Stress, write_sample, write_video};
use litetex_gs::text::counted;
use serde_json::json;
use std::path::PathBuf;

/// Generate a small synthetic capture for trying things out
///
/// A ray-cast still life with rich texture in COLMAP layout: photos, exact poses, sparse points and ground-truth depths.
/// Equal options give equal bytes.
#[derive(clap::Args)]
#[command(args_override_self = true)]
pub struct SampleArgs {
    /// Folder to write into; must be empty
    dir: PathBuf,
    /// Number of photos
    #[arg(long, value_name = "N", value_parser = parse_whole::<usize>, default_value_t = SampleOptions::default().views)]
    views: usize,
    /// Width and height of the photos
    #[arg(long, value_name = "WxH", value_parser = parse_image_size, default_value = "320x240")]
    size: ImageSize,
    /// Number of sparse points
    #[arg(long, value_name = "N", value_parser = parse_whole::<usize>, default_value_t = SampleOptions::default().points)]
    points: usize,
    /// Seed of patterns, placement and points
    #[arg(long, value_name = "N", value_parser = parse_whole::<u64>, default_value_t = 0)]
    seed: u64,
    /// Rays per pixel along each axis
    #[arg(long, value_name = "N", value_parser = parse_whole::<u32>, default_value_t = SampleOptions::default().supersampling)]
    rays: u32,
    /// Make the capture hard in one respect, to see where methods fail; test.txt lists the test photos, which stay
    /// clean, for --test-list
    #[arg(long, value_name = "NAME[:LEVEL]", long_help = stress_help())]
    stress: Option<Stress>,
    /// Show a scene other than the still life: one whose smallest model is known, to see what models grow to, or a poster
    /// with noise as in photos, sharp borders and lettering; test.txt lists the test photos
    #[arg(long, value_name = "NAME[:LEVEL]", conflicts_with = "stress", long_help = scene_help())]
    scene: Option<NamedScene>,
    /// Write a video of N frames in place of photos and poses, once around the scene, blurred in two of three frames, for
    /// "litetex capture"; the poses are in truth/poses.json
    #[arg(long, value_name = "N", value_parser = parse_whole::<usize>, conflicts_with_all = ["stress", "scene", "text"])]
    video: Option<usize>,
    /// Also write the sparse model as text
    #[arg(long)]
    text: bool,
    /// Omit the ground-truth depths and the description of the scene
    #[arg(long)]
    no_truth: bool,
}

fn stress_help() -> String {
    format!(
        "Make the capture hard in one respect, to see where methods fail; test.txt lists the test photos, which stay \
         clean, for --test-list. NAME[:LEVEL], with default levels: {}",
        Stress::help()
    )
}

fn scene_help() -> String {
    format!(
        "Show a scene other than the still life: one whose smallest model is known, to see what models grow to, or a \
         poster with noise as in photos, sharp borders and lettering, of which no smallest model is known; test.txt lists the \
         test photos, for --test-list. The colour around it is #808080, for --set background=. NAME[:LEVEL], with default \
         levels: {}",
        NamedScene::help()
    )
}

impl SampleArgs {
    /// The options that are meant.
    pub fn options(&self) -> SampleOptions {
        let (width_px, height_px) = match self.size {
            ImageSize::Exact(w, h) => (w, h),
            ImageSize::Longer(w) => (w, (w * 3 / 4).max(1)),
        };
        SampleOptions {
            views: self.views,
            width_px,
            height_px,
            seed: self.seed,
            points: self.points,
            supersampling: self.rays,
            stress: self.stress,
            scene: self.scene,
            text: self.text,
            truth: !self.no_truth,
            ..SampleOptions::default()
        }
    }
}

/// Writes the capture and prints its figures.
pub fn run(args: &SampleArgs, log: &Log) -> Result<Output> {
    check_empty(&args.dir)?;
    let options = args.options();
    if let Some(frames) = args.video {
        log.info(&format!(
            "ray-casting {} of {} x {}",
            counted(frames, "frame"),
            options.width_px,
            options.height_px
        ));
        write_video(&args.dir, &options, frames)?;
        let file = args.dir.join("video.avi");
        let mut table = Table::default();
        table.row("video", file.display());
        table.row("frames", frames);
        let found = json!({ "video": path_text(&file), "frames": frames });
        return Ok(Output::new("litetex-sample/1", found, table));
    }
    log.info(&format!(
        "ray-casting {} of {} x {}",
        counted(options.views, "photo"),
        options.width_px,
        options.height_px
    ));
    let made = write_sample(&args.dir, &options)?;
    let mut table = Table::default();
    table.row("capture", args.dir.display());
    table.row("photos", made.views);
    if made.test_views > 0 {
        let what = format!("{} (--test-list {})", made.test_views, args.dir.join("test.txt").display());
        table.row("test photos", what);
    }
    table.row("points", made.points);
    table.row("observations", made.observations);
    table.row("mean reprojection error", format!("{:.2} px", made.mean_reprojection_error_px));
    let found = json!({
        "capture": path_text(&args.dir),
        "photos": made.views,
        "test_photos": made.test_views,
        "points": made.points,
        "observations": made.observations,
        "mean_reprojection_error_px": made.mean_reprojection_error_px,
    });
    Ok(Output::new("litetex-sample/1", found, table))
}
