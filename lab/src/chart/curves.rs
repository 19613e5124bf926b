//! Charts of quality during training, over time and over steps, with the range of the seeds.

use super::plot::{Axis, Chart, Mark, Quantity, Series, Spacing};
use super::scale::{counted, number};
use super::section::{Section, axis, missing_times};
use super::stats::Stats;
use super::study::{CurvePoint, Group, Study};
use std::collections::HashSet;

/// The charts of a scene, by budget.
pub fn curves(study: &Study, scene: &str, slug: &str) -> Section {
    let mut charts = Vec::new();
    let mut names = HashSet::new();
    for budget in &study.budgets {
        let budget_slug = super::section::slug(budget, &mut names);
        for (quality, of) in
            study.qualities[..2].iter().zip([psnr_of as fn(&CurvePoint) -> Option<f64>, grad_of])
        {
            for is_time in [true, false] {
                let series: Vec<Series> = study
                    .variants
                    .iter()
                    .filter_map(|v| curve_series(study, &study.group(scene, v, budget), of, is_time))
                    .collect();
                if series.is_empty() {
                    continue;
                }
                let (id, title, x) = if is_time {
                    ("time", "over time", axis(&study.time))
                } else {
                    let steps = Axis {
                        name: "Training steps".to_owned(),
                        spacing: Spacing::Linear,
                        quantity: Quantity::Count,
                    };
                    ("steps", "over steps", steps)
                };
                let which = if study.budgets.len() > 1 { format!(", {budget}") } else { String::new() };
                charts.push(Chart {
                    id: format!("{slug}-{}-over-{id}-{budget_slug}", quality.id).replace('_', "-"),
                    title: format!("{scene}{which}: {} {title}", quality.name),
                    x,
                    y: Axis { name: quality.title(), spacing: Spacing::Linear, quantity: Quantity::Plain },
                    series,
                    front: Vec::new(),
                    events: Vec::new(),
                });
            }
        }
    }
    let note = if charts.is_empty() {
        "The runs were evaluated only at their end; litetex train --eval-every N records a curve.".to_owned()
    } else {
        format!(
            "Means over the seeds; bands span the seeds from lowest to highest. {}",
            missing_times(study, scene)
        )
    };
    Section { title: format!("Quality over time: {scene}"), note: note.trim_end().to_owned(), charts }
}

fn psnr_of(p: &CurvePoint) -> Option<f64> {
    p.psnr
}

fn grad_of(p: &CurvePoint) -> Option<f64> {
    p.grad_psnr
}

/// Mean and range at the steps at which all runs were evaluated; `None` if there are fewer than two such steps.
fn curve_series(
    study: &Study,
    group: &Group<'_>,
    quality: fn(&CurvePoint) -> Option<f64>,
    is_time: bool,
) -> Option<Series> {
    let point = |p: CurvePoint| Some((p.step, if is_time { p.secs? } else { p.step }, quality(&p)?));
    let runs = group.runs.iter().filter(|r| !is_time || study.counts_time(r));
    let curves: Vec<Vec<(f64, f64, f64)>> =
        runs.map(|r| study.curve(r).into_iter().filter_map(point).collect()).collect();
    let mut series =
        Series { name: group.variant.to_owned(), look: study.look(group.variant), ..Series::default() };
    for &(step, ..) in curves.first()? {
        let at: Vec<(f64, f64)> =
            curves.iter().filter_map(|c| c.iter().find(|p| p.0 == step).map(|&(_, x, y)| (x, y))).collect();
        if at.len() < curves.len() {
            continue;
        }
        let x = Stats::of(&at.iter().map(|p| p.0).collect::<Vec<_>>())?;
        let y = Stats::of(&at.iter().map(|p| p.1).collect::<Vec<_>>())?;
        series.line.push((x.mean, y.mean));
        if y.n > 1 {
            series.band.push((x.mean, y.min, y.max));
        }
        let range = if y.n > 1 {
            format!(" ({:.2} to {:.2}, {})", y.min, y.max, counted(y.n, "run"))
        } else {
            String::new()
        };
        let secs = if is_time { format!("{} s, ", number(x.mean, 1)) } else { String::new() };
        let hover =
            format!("{}: {:.2} dB{range} after {secs}step {}", group.variant, y.mean, number(step, 0));
        series.dots.push(Mark { at: (x.mean, y.mean), hover, label: None, grey: false });
    }
    (series.line.len() > 1).then_some(series)
}
