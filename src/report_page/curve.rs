//! The curve of a training, from the lines of `metrics.jsonl`, and its drawing.

use super::escape::escaped_text;
use crate::text::{format_count, format_duration};
use serde_json::Value;
use std::fmt::Write as _;

/// Most points of a drawn curve; where there are more, some are left out evenly.
const POINTS_MAX: usize = 400;

/// Size of a drawing, in units of its own, as those below.
const SIZE: [f64; 2] = [520.0, 220.0];
/// Where the plot begins and ends, from left to right.
const LEFT: f64 = 52.0;
const RIGHT: f64 = 508.0;
/// Where it begins and ends, from top to bottom.
const TOP: f64 = 12.0;
const BOTTOM: f64 = 176.0;

/// A point: steps done, training time in seconds, value.
type Point = (u32, f64, f64);

/// Losses and evaluations over steps and training time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainingCurve {
    /// Total loss of single steps.
    pub losses: Vec<Point>,
    /// Mean PSNR of the test views, dB.
    pub psnrs: Vec<Point>,
}

impl TrainingCurve {
    /// Takes the curve out of the text of a `metrics.jsonl`. Lines that are cut off or of another kind are left out, as is what a
    /// resumed training did again.
    pub fn from_metrics(text: &str) -> Self {
        let mut curve = Self::default();
        for line in text.lines() {
            let Ok(line) = serde_json::from_str::<Value>(line) else { continue };
            let step = line["step"].as_u64().and_then(|step| u32::try_from(step).ok()).unwrap_or(0);
            let point = |secs: &Value, value: &Value| {
                let point = (step, secs.as_f64()?, value.as_f64()?);
                (point.1.is_finite() && point.2.is_finite()).then_some(point)
            };
            match line["event"].as_str() {
                Some("started") => {
                    curve.losses.retain(|p| p.0 <= step);
                    curve.psnrs.retain(|p| p.0 <= step);
                }
                Some("step") => curve.losses.extend(point(&line["train_wall_secs"], &line["loss"]["total"])),
                Some("evaluated") => {
                    curve.psnrs.retain(|p| p.0 != step);
                    curve.psnrs.extend(point(&line["point"]["wall_secs"], &line["point"]["psnr_test"]));
                }
                _ => {}
            }
        }
        curve
    }

    /// Drawings of the curves that have two points or more.
    pub(super) fn drawings(&self) -> Vec<String> {
        let all = [("Loss", "", &self.losses, false), ("Test PSNR", "dB", &self.psnrs, true)];
        let drawn = all.into_iter().filter(|(_, _, points, _)| points.len() > 1);
        drawn.map(|(name, unit, points, dots)| drawing(name, unit, points, dots)).collect()
    }
}

/// A curve as a figure; `dots` marks each point.
fn drawing(name: &str, unit: &str, points: &[Point], dots: bool) -> String {
    let every = points.len().div_ceil(POINTS_MAX);
    let last = points.len() - 1;
    let shown: Vec<Point> = points
        .iter()
        .enumerate()
        .filter(|(i, _)| i % every == 0 || *i == last)
        .map(|(_, point)| *point)
        .collect();
    let steps = f64::from(points[last].0.max(1));
    let (low, high) =
        shown.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.2), h.max(p.2)));
    let range = if high > low { high - low } else { 1.0 };
    let x = |step: u32| LEFT + (RIGHT - LEFT) * f64::from(step) / steps;
    let y = |value: f64| BOTTOM - (BOTTOM - TOP) * (value - low) / range;
    let digits = if range < 0.2 { 3 } else { 2 };
    let summary = format!(
        "{name}: {:.digits$} {unit} at step {}, {:.digits$} {unit} at step {}",
        points[0].2,
        format_count(points[0].0.into()),
        points[last].2,
        format_count(points[last].0.into())
    );
    let mut svg = format!(
        "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">",
        SIZE[0],
        SIZE[1],
        escaped_text(&summary)
    );
    for share in [0.0, 0.5, 1.0] {
        let value = low + share * range;
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{RIGHT}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/><text x=\"{}\" y=\"{:.1}\" \
             text-anchor=\"end\">{value:.digits$}</text>",
            LEFT - 6.0,
            y(value) + 4.0,
            at = y(value)
        );
    }
    for (share, anchor) in [(0.0, "start"), (0.5, "middle"), (1.0, "end")] {
        let step = (share * steps).round() as u32;
        let secs = time_at(points, step);
        let _ = write!(
            svg,
            "<text x=\"{0:.1}\" y=\"{1}\" text-anchor=\"{anchor}\">{2}</text><text x=\"{0:.1}\" y=\"{3}\" \
             text-anchor=\"{anchor}\">{4}</text>",
            x(step),
            BOTTOM + 18.0,
            if step == 0 { "step 0".to_owned() } else { format_count(step.into()) },
            BOTTOM + 36.0,
            if step == 0 { "0 s".to_owned() } else { format_duration(secs) },
        );
    }
    let line: Vec<String> = shown.iter().map(|p| format!("{:.1},{:.1}", x(p.0), y(p.2))).collect();
    let _ = write!(svg, "<polyline class=\"curve\" points=\"{}\"/>", line.join(" "));
    for point in shown.iter().filter(|_| dots) {
        let _ =
            write!(svg, "<circle class=\"dot\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\"/>", x(point.0), y(point.2));
    }
    svg.push_str("</svg>");
    let unit = if unit.is_empty() { String::new() } else { format!(", {unit}") };
    format!("<figure>{svg}<figcaption>{name}{unit}, over steps and training time</figcaption></figure>")
}

/// Training time after a step, seconds, between the points around it.
fn time_at(points: &[Point], step: u32) -> f64 {
    let after = points.partition_point(|p| p.0 < step);
    let Some(b) = points.get(after) else { return points.last().map_or(0.0, |p| p.1) };
    let a = after.checked_sub(1).map_or((0, 0.0, 0.0), |before| points[before]);
    let steps = f64::from(b.0 - a.0);
    if steps > 0.0 { a.1 + (b.1 - a.1) * f64::from(step - a.0) / steps } else { b.1 }
}
