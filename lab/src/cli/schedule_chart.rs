//! `litetex-lab schedule-chart`: a schedule as a chart over the steps, scales above, the texture cap below.

use litetex_gs::console::{Log, Output, check_free, path_text};
use litetex_gs::frequency::FrequencySchedule;
use litetex_gs::train::StageSpan;
use litetex_gs::{Error, Result, atomic_file, input_file};
use litetex_lab::chart::plot::{Axis, Chart, Quantity, Series, stacked};
use serde::Deserialize;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Largest schedule that is read.
const FILE_BYTES_MAX: u64 = 1 << 26;
/// Points of the continuous scale's curve.
const CURVE_POINTS: u32 = 600;

/// Draw the schedule of a capture as SVG
///
/// Reads what "litetex schedule <CAPTURE> --json" prints.
#[derive(clap::Args)]
pub struct ScheduleChartArgs {
    /// JSON of "litetex schedule"
    schedule: PathBuf,
    /// SVG file to write
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Replace the chart if it exists
    #[arg(long)]
    force: bool,
}

/// What the chart needs of a schedule.
#[derive(Deserialize)]
struct Plan {
    capture: PathBuf,
    steps: u32,
    schedule_steps: u32,
    densify_until: u32,
    schedule: FrequencySchedule,
    width_px: u32,
    height_px: u32,
    stages: Vec<StageSpan>,
    pixel_work: f64,
}

/// Reads a schedule and writes its chart.
pub fn run(args: &ScheduleChartArgs, log: &Log) -> Result<Output> {
    check_free(std::slice::from_ref(&args.out), args.force)?;
    let plan = read(&args.schedule)?;
    atomic_file::write(&args.out, svg(&plan).as_bytes())?;
    log.info(&format!("wrote {}", args.out.display()));
    Ok(Output::new("litetex-schedule-chart/1", json!({ "chart": path_text(&args.out) }), ""))
}

fn read(path: &Path) -> Result<Plan> {
    let bytes = input_file::read(path, FILE_BYTES_MAX)?;
    let expected = "expected what \"litetex schedule <CAPTURE> --json\" prints";
    serde_json::from_slice(&bytes).map_err(|e| Error::invalid(path, format!("{e}; {expected}")))
}

/// The chart as SVG; empty if the schedule has no stage.
fn svg(plan: &Plan) -> String {
    stacked(&[scales(plan), caps(plan)]).unwrap_or_default()
}

/// The continuous scale that the photos ask for, and the one that is rendered.
fn scales(plan: &Plan) -> Chart {
    let name = plan.capture.file_name().unwrap_or(plan.capture.as_os_str()).to_string_lossy();
    let curve = (0..=CURVE_POINTS).map(|i| {
        let step = f64::from(plan.steps) * f64::from(i) / f64::from(CURVE_POINTS);
        (step, plan.schedule.scale(step / f64::from(plan.schedule_steps)))
    });
    Chart {
        id: "scales".to_owned(),
        title: format!(
            "Frequency schedule of {name}: {} views of {}x{} px, pixel work {:.0} %",
            plan.schedule.views,
            plan.width_px,
            plan.height_px,
            100.0 * plan.pixel_work
        ),
        x: steps(),
        y: axis("Scale (full size = 1)", Quantity::Plain),
        series: vec![
            line("rendered, r", 1, staircase(&plan.stages, |s| s.render_scale)),
            line("required by the photos, s", 0, curve.collect()),
        ],
        events: events(plan, ["densification ends", "full size from here"]),
    }
}

/// The largest map side that the stages allow.
fn caps(plan: &Plan) -> Chart {
    Chart {
        id: "caps".to_owned(),
        title: "Texture cap".to_owned(),
        x: steps(),
        y: Axis { is_log: true, ..axis("Texels per side", Quantity::Plain) },
        series: vec![line("texture cap", 2, staircase(&plan.stages, |s| s.texture_cap.into()))],
        // Labelled in the panel above.
        events: events(plan, ["", ""]),
    }
}

fn events(plan: &Plan, labels: [&str; 2]) -> Vec<(f64, String)> {
    let steps = [plan.densify_until, plan.schedule_steps];
    steps.into_iter().zip(labels).map(|(step, label)| (f64::from(step), label.to_owned())).collect()
}

fn axis(name: &str, quantity: Quantity) -> Axis {
    Axis { name: name.to_owned(), quantity, ..Axis::default() }
}

fn steps() -> Axis {
    axis("Training step", Quantity::Count)
}

fn line(name: &str, look: usize, points: Vec<(f64, f64)>) -> Series {
    Series { name: name.to_owned(), look: Some(look), line: points, ..Series::default() }
}

/// A level that is constant during each stage.
fn staircase(stages: &[StageSpan], level: impl Fn(&StageSpan) -> f64) -> Vec<(f64, f64)> {
    let ends = |s: &StageSpan| [f64::from(s.first_step - 1), f64::from(s.last_step)];
    stages.iter().flat_map(|s| ends(s).map(|step| (step, level(s)))).collect()
}
