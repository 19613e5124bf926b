//! `litetex capture`: makes a capture of a video or of photos without poses.

use super::progress::{BAR_INTERVAL, LINE_INTERVAL, bar};
use indicatif::ProgressBar;
use litetex_gs::Result;
use litetex_gs::console::values::whole;
use litetex_gs::console::{Interrupt, Log, Output, Table, path_text};
use litetex_gs::structure_from_motion::{Observer, Plan, PoseQuality, Settings};
use litetex_gs::text::{format_duration, shell_word};
use serde_json::json;
use std::cell::RefCell;
use std::path::PathBuf;
use std::time::Instant;

/// With fewer registered photos than this share, the capture should be taken again.
const REGISTERED_MIN: f64 = 0.7;

/// Make a capture of a video, or of photos without poses
///
/// Takes the sharpest frames of a video with ffmpeg, or converts photos, and finds their poses with pycolmap
/// (version 4, from PyPI) or COLMAP (3.8 or later). What was interrupted goes on when the same command is run
/// again.
#[derive(clap::Args)]
#[command(args_override_self = true)]
pub struct CaptureArgs {
    /// A video, photos, or folders of these
    #[arg(required = true, value_name = "VIDEO|PHOTOS")]
    inputs: Vec<PathBuf>,
    /// Folder of the capture; must be empty or hold an interrupted one
    #[arg(long, short, value_name = "CAPTURE")]
    out: PathBuf,
    /// What is spent on the poses: fast looks for 3,000 features at 1,200 px, full for 8,192 at 3,200 px
    #[arg(long, value_name = "HOW", default_value = "fast")]
    poses: Poses,
    /// Frames to take of a video [default: 3 a second, 150 to 300]
    #[arg(long, value_name = "N", value_parser = whole::<usize>(3..=5000))]
    frames: Option<usize>,
    /// The Python that has pycolmap [default: $LITETEX_PYTHON, else python3 or python on the PATH]
    #[arg(long, value_name = "FILE")]
    python: Option<PathBuf>,
    /// Use this COLMAP instead of pycolmap
    #[arg(long, value_name = "FILE", conflicts_with = "python")]
    colmap: Option<PathBuf>,
    /// Print the commands that do the same, and do nothing
    #[arg(long)]
    print: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Poses {
    Fast,
    Full,
}

/// Shows how far the work is: a bar on a terminal, elsewhere a line every few seconds.
struct Shown<'a> {
    log: &'a Log,
    interrupt: Interrupt,
    step: RefCell<Step>,
}

struct Step {
    what: String,
    bar: Option<ProgressBar>,
    start: Instant,
    shown: Instant,
}

impl<'a> Shown<'a> {
    fn new(log: &'a Log, interrupt: Interrupt) -> Self {
        let now = Instant::now();
        let step = RefCell::new(Step { what: String::new(), bar: None, start: now, shown: now });
        Self { log, interrupt, step }
    }

    fn finish(&self) {
        let mut step = self.step.borrow_mut();
        self.log.attach_bar(None);
        if let Some(bar) = step.bar.take() {
            bar.finish_and_clear();
        }
        if !step.what.is_empty() {
            let took = format_duration(step.start.elapsed().as_secs_f64());
            self.log.detail(&format!("{}: {took}", step.what));
        }
    }
}

impl Observer for Shown<'_> {
    fn check(&self) -> Result<()> {
        self.interrupt.check()
    }

    fn step(&self, what: &str) {
        self.finish();
        self.log.event("step", what, json!({ "step": what }));
        let bar = bar(self.log, 0);
        self.log.attach_bar(bar.clone());
        let now = Instant::now();
        *self.step.borrow_mut() = Step { what: what.to_owned(), bar, start: now, shown: now };
    }

    fn progress(&self, done: usize, all: usize) {
        let mut step = self.step.borrow_mut();
        let interval = if step.bar.is_some() { BAR_INTERVAL } else { LINE_INTERVAL };
        if done == 0 || step.shown.elapsed() < interval {
            return;
        }
        step.shown = Instant::now();
        let eta_secs = step.start.elapsed().as_secs_f64() * all.saturating_sub(done) as f64 / done as f64;
        let text = format!("ETA {}", format_duration(eta_secs));
        if let Some(bar) = &step.bar {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
            bar.set_message(format!("{}, {text}", step.what));
            return;
        }
        let fields = json!({ "step": step.what, "done": done, "all": all, "eta_secs": eta_secs });
        self.log.event("progress", &format!("{}: {done}/{all}, {text}", step.what), fields);
    }
}

impl Drop for Shown<'_> {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Makes the capture and says how many photos have poses.
pub fn run(args: &CaptureArgs, log: &Log) -> Result<Output> {
    let settings = Settings {
        quality: match args.poses {
            Poses::Fast => PoseQuality::Fast,
            Poses::Full => PoseQuality::Full,
        },
        frames: args.frames,
        python: args.python.clone(),
        colmap: args.colmap.clone(),
        threads: rayon_threads(),
    };
    let plan = Plan::new(&args.inputs, &args.out, &settings)?;
    log.report(plan.report());
    if args.print {
        return Ok(Output::text(plan.by_hand()));
    }
    plan.check_place()?;
    plan.check_tools()?;
    log.info(&plan.describe());
    let start = Instant::now();
    let shown = Shown::new(
        log,
        Interrupt::listen(log, "ending the program that runs; the same command goes on from here")?,
    );
    let made = plan.run(&shown)?;
    drop(shown);
    let share = made.registered as f64 / made.photos.max(1) as f64;
    let mut table = Table::default();
    table.row("capture", args.out.display());
    if let Some(frames) = made.frames {
        table.row("frames", format!("{} of {}, the sharpest", frames.taken, frames.looked_at));
    }
    table.row("cameras", made.cameras);
    table.row("poses by", &made.engine);
    table.row("time", format_duration(start.elapsed().as_secs_f64()));
    let (registered, percent) = (made.registered, (100.0 * share).floor());
    let last = format!("{registered} of {} photos have poses ({percent} %)", made.photos);
    let remedy = (share < REGISTERED_MIN).then(|| remedy(args));
    let text = match &remedy {
        None => format!("{table}{last}; next: litetex train {} -o RUN\n", shell_word(&args.out)),
        Some(remedy) => format!("{table}{last}: {remedy}\n"),
    };
    let found = json!({
        "capture": path_text(&args.out),
        "photos": made.photos,
        "registered": made.registered,
        "cameras": made.cameras,
        "frames_looked_at": made.frames.map(|f| f.looked_at),
        "poses_by": made.engine,
        "secs": start.elapsed().as_secs_f64(),
        "remedy": remedy,
    });
    Ok(Output::new("litetex-capture/1", found, text))
}

/// What to do if many photos have no pose.
fn remedy(args: &CaptureArgs) -> String {
    let better = if matches!(args.poses, Poses::Fast) {
        "try --poses full into another folder, or shoot again"
    } else {
        "shoot again"
    };
    format!(
        "{better}: move slowly and sideways around the scene instead of turning on the spot, keep two thirds of each photo in \
         the next, avoid blur, blank walls, mirrors and moving things, and end where you began"
    )
}

/// The number that `--threads` asked for, if it did.
fn rayon_threads() -> Option<u16> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads = rayon::current_num_threads();
    (threads != cores).then(|| u16::try_from(threads).unwrap_or(u16::MAX))
}
