//! A schedule as a chart over the steps: scales above, the texture cap below. `litetex-lab` draws it.

use super::schedule_report::ScheduleReport;
use litetex_gs::train::StageSpan;
use litetex_lab::chart::plot::{Axis, Chart, Quantity, Series, Spacing, stacked};

/// Points of the continuous scale's curve.
const CURVE_POINTS: u32 = 600;

/// The chart as SVG; empty if the schedule has no stage.
pub fn svg(plan: &ScheduleReport) -> String {
    stacked(&[scales(plan), caps(plan)]).unwrap_or_default()
}

/// The continuous scale that the photos ask for, and the one that is rendered.
fn scales(plan: &ScheduleReport) -> Chart {
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
        y: axis("Scale (full size = 1)", Spacing::Linear, Quantity::Plain),
        series: vec![
            line("rendered, r", 1, staircase(&plan.stages, |s| s.render_scale)),
            line("required by the photos, s", 0, curve.collect()),
        ],
        front: Vec::new(),
        events: events(plan, ["densification ends", "full size from here"]),
    }
}

/// The largest map side that the stages allow.
fn caps(plan: &ScheduleReport) -> Chart {
    Chart {
        id: "caps".to_owned(),
        title: "Texture cap".to_owned(),
        x: steps(),
        y: axis("Texels per side", Spacing::Log2, Quantity::Plain),
        series: vec![line("texture cap", 2, staircase(&plan.stages, |s| s.texture_cap.into()))],
        front: Vec::new(),
        // Labelled in the panel above.
        events: events(plan, ["", ""]),
    }
}

fn events(plan: &ScheduleReport, labels: [&str; 2]) -> Vec<(f64, String)> {
    let steps = [plan.densify_until, plan.schedule_steps];
    steps.into_iter().zip(labels).map(|(step, label)| (f64::from(step), label.to_owned())).collect()
}

fn axis(name: &str, spacing: Spacing, quantity: Quantity) -> Axis {
    Axis { name: name.to_owned(), spacing, quantity }
}

fn steps() -> Axis {
    axis("Training step", Spacing::Linear, Quantity::Count)
}

fn line(name: &str, look: usize, points: Vec<(f64, f64)>) -> Series {
    Series { name: name.to_owned(), look, line: points, ..Series::default() }
}

/// A level that is constant during each stage.
fn staircase(stages: &[StageSpan], level: impl Fn(&StageSpan) -> f64) -> Vec<(f64, f64)> {
    let ends = |s: &StageSpan| [f64::from(s.first_step - 1), f64::from(s.last_step)];
    stages.iter().flat_map(|s| ends(s).map(|step| (step, level(s)))).collect()
}
