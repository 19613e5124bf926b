//! The charts of a study: quality against cost with its Pareto front, quality during training, and differences to the
//! baseline.

use super::compare::{Conclusion, Scope, compare};
use super::measure::Measure;
use super::plot::{Axis, Chart, Mark, Quantity, Series};
use super::scale::number;
use super::study::{Group, Study};
use crate::results::Record;
use crate::stats::{Stats, pareto_front};
use litetex_gs::text::counted;
use std::collections::HashSet;

/// Charts of one kind, or why there are none.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    pub title: String,
    /// How to read the charts, and what is missing from them.
    pub note: String,
    pub charts: Vec<Chart>,
}

/// All sections, in the order of the page.
pub fn sections(study: &Study) -> Vec<Section> {
    let mut names = HashSet::new();
    let scenes: Vec<(&String, String)> =
        study.scenes.iter().map(|s| (s, unused(&slug(s), &mut names))).collect();
    let by_cost = scenes.iter().map(|(scene, slug)| quality_by_cost(study, scene, slug));
    let curves = scenes.iter().map(|(scene, slug)| curves(study, scene, slug));
    by_cost.chain(curves).chain([differences(study)]).collect()
}

fn quality_by_cost(study: &Study, scene: &str, slug: &str) -> Section {
    let mut charts = Vec::new();
    for cost in [&study.time, &study.params].into_iter().chain(&study.bytes).chain(&study.layers) {
        for quality in &study.qualities[..2] {
            let mut series: Vec<Series> =
                study.variants.iter().filter_map(|v| cost_series(study, scene, v, cost, quality)).collect();
            let means: Vec<(f64, f64)> = series.iter().flat_map(|s| &s.line).copied().collect();
            if means.len() > 1 {
                series.push(front(&means));
            }
            charts.push(Chart {
                id: format!("{slug}-{}-{}", quality.id, cost.id).replace('_', "-"),
                title: format!("{scene}: {} by {}", quality.name, cost.name.to_lowercase()),
                x: cost.axis(),
                y: quality.axis(),
                series,
                events: Vec::new(),
            });
        }
    }
    charts.retain(|chart| !chart.series.is_empty());
    let several = if study.budgets.len() > 1 { "; lines connect the budgets of a variant" } else { "" };
    let note = format!(
        "Large markers are means over the seeds, small ones single runs{several}. A mean below the front is dominated: \
         another one costs no more and is at least as good. {}",
        missing_times(study, scene)
    );
    Section { title: format!("Quality by cost: {scene}"), note, charts }
}

fn cost_series(
    study: &Study,
    scene: &str,
    variant: &str,
    cost: &Measure,
    quality: &Measure,
) -> Option<Series> {
    let mut series = Series { name: variant.to_owned(), look: study.look(variant), ..Series::default() };
    for budget in &study.budgets {
        let group = study.group(scene, variant, budget);
        let both = |r: &&Record| Some((r.seed, (study.value(r, cost)?, study.value(r, quality)?)));
        let runs: Vec<(u64, (f64, f64))> = group.runs.iter().filter_map(both).collect();
        let stats = |of: fn((f64, f64)) -> f64| Stats::of(&runs.iter().map(|r| of(r.1)).collect::<Vec<_>>());
        let (Some(x), Some(y)) = (stats(|at| at.0), stats(|at| at.1)) else { continue };
        let hover = format!(
            "{variant}, {budget}: {}{} at {} ({})",
            quality.amount(y.mean),
            y.sd.map_or(String::new(), |sd| format!(" (sd {sd:.*})", quality.digits)),
            cost.amount(x.mean),
            counted(y.n, "run")
        );
        let label = if study.budgets.len() > 1 { budget.clone() } else { String::new() };
        series.line.push((x.mean, y.mean));
        series.marks.push(Mark { at: (x.mean, y.mean), hover, label, ..Mark::default() });
        for &(seed, at) in runs.iter().filter(|_| runs.len() > 1) {
            let figures = format!("{} at {}", quality.amount(at.1), cost.amount(at.0));
            let hover = format!("{variant}, {budget}, seed {seed}: {figures}");
            series.marks.push(Mark { at, hover, is_small: true, ..Mark::default() });
        }
    }
    series.line.sort_by(|a, b| a.0.total_cmp(&b.0));
    (!series.marks.is_empty()).then_some(series)
}

/// The steps of the Pareto front of (cost, quality).
fn front(means: &[(f64, f64)]) -> Series {
    let of_front = means.iter().zip(pareto_front(means)).filter(|(_, is_front)| *is_front);
    let mut points: Vec<(f64, f64)> = of_front.map(|(at, _)| *at).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut line = points[..1].to_vec();
    line.extend(points.windows(2).flat_map(|w| [(w[1].0, w[0].1), w[1]]));
    Series { name: "Pareto front".to_owned(), line, ..Series::default() }
}

fn curves(study: &Study, scene: &str, slug: &str) -> Section {
    let mut charts = Vec::new();
    let mut names = HashSet::new();
    let steps = Axis { name: "Training steps".to_owned(), quantity: Quantity::Count, ..Axis::default() };
    for budget in &study.budgets {
        let budget_slug = unused(&self::slug(budget), &mut names);
        let which = if study.budgets.len() > 1 { format!(", {budget}") } else { String::new() };
        for quality in &study.qualities[..2] {
            for (over, x_key, x) in
                [("time", &*study.time.id, study.time.axis()), ("steps", "step", steps.clone())]
            {
                let groups = study.variants.iter().map(|v| study.group(scene, v, budget));
                charts.push(Chart {
                    id: format!("{slug}-{}-over-{over}-{budget_slug}", quality.id).replace('_', "-"),
                    title: format!("{scene}{which}: {} over {over}", quality.name),
                    x,
                    y: quality.axis(),
                    series: groups.filter_map(|group| curve(study, &group, x_key, quality)).collect(),
                    events: Vec::new(),
                });
            }
        }
    }
    charts.retain(|chart| !chart.series.is_empty());
    let note = if charts.is_empty() {
        "The runs were evaluated only at their end; litetex train --set eval-every=N records a curve."
            .to_owned()
    } else {
        let missing = missing_times(study, scene);
        format!("Means over the seeds; bands span the seeds from lowest to highest. {missing}")
    };
    Section { title: format!("Quality over time: {scene}"), note, charts }
}

/// Mean and range at the steps at which all runs were evaluated; `None` if there are fewer than two such steps.
fn curve(study: &Study, group: &Group<'_>, x_key: &str, quality: &Measure) -> Option<Series> {
    let y_key = format!("{}_test", quality.id);
    let runs = group.runs.iter().filter(|r| x_key == "step" || study.counts_time(r));
    let curves: Vec<Vec<[f64; 3]>> = runs.map(|r| r.points("/curve", ["step", x_key, &y_key])).collect();
    let mut series =
        Series { name: group.variant.to_owned(), look: study.look(group.variant), ..Series::default() };
    for &[step, ..] in curves.first()? {
        let at: Vec<[f64; 3]> =
            curves.iter().filter_map(|c| c.iter().find(|p| p[0] == step)).copied().collect();
        if at.len() < curves.len() {
            continue;
        }
        let [x, y] = [1, 2].map(|i| Stats::of(&at.iter().map(|p| p[i]).collect::<Vec<_>>()));
        let (x, y) = (x?, y?);
        series.line.push((x.mean, y.mean));
        let mut hover = format!("{}: {} at step {}", group.variant, quality.amount(y.mean), number(step, 0));
        if y.n > 1 {
            series.band.push((x.mean, y.min, y.max));
            hover += &format!(" ({:.2} to {:.2}, {})", y.min, y.max, counted(y.n, "run"));
        }
        series.marks.push(Mark { at: (x.mean, y.mean), hover, is_small: true, ..Mark::default() });
    }
    (series.line.len() > 1).then_some(series)
}

/// Mean differences to the baseline with their 95 % intervals, a row per variant, scene and budget.
fn differences(study: &Study) -> Section {
    let charts = study.qualities[..2].iter().chain([&study.time]).map(|measure| {
        let mut rows = Vec::new();
        let mut undecided = Series { name: "not decided".to_owned(), ..Series::default() };
        let mut series = Vec::new();
        for variant in study.others() {
            let mut decided =
                Series { name: variant.clone(), look: study.look(variant), ..Series::default() };
            for scope in Scope::all(study).into_iter().filter(|scope| *scope != Scope::SceneMeans) {
                let found = compare(study, variant, scope, measure);
                let Some(mean) = found.mean() else { continue };
                let numbers = format!("{}, n = {}", measure.signed(mean), found.n());
                let row = match scope {
                    Scope::SceneBudget(scene, budget) => format!("{scene}, {budget}: {numbers}"),
                    _ => format!("{variant}: {numbers}"),
                };
                let is_decided = matches!(found.conclusion, Conclusion::Better | Conclusion::Worse);
                let marks = if is_decided { &mut decided.marks } else { &mut undecided.marks };
                marks.push(Mark {
                    at: (mean, -(rows.len() as f64)),
                    hover: format!("{row}; {}", found.words()),
                    interval: found.interval(),
                    ..Mark::default()
                });
                rows.push(row);
            }
            series.push(decided);
        }
        series.push(undecided);
        series.retain(|s| !s.marks.is_empty());
        let unit = if measure.is_cost { "%" } else { measure.unit };
        Chart {
            id: format!("paired-{}", measure.id).replace('_', "-"),
            title: format!("{}: difference to {}", measure.name, study.baseline),
            x: Axis { name: unit.to_owned(), ..Axis::default() },
            y: Axis {
                name: "Mean of paired differences and 95 % interval".to_owned(),
                rows,
                ..Axis::default()
            },
            series,
            events: vec![(0.0, String::new())],
        }
    });
    let charts = charts.filter(|chart| !chart.series.is_empty()).collect();
    let note = "Coloured where the interval excludes 0, grey where it does not.".to_owned();
    Section { title: "Differences to the baseline".to_owned(), note, charts }
}

/// Explains why a chart of time has fewer points than one of size; empty if it does not.
fn missing_times(study: &Study, scene: &str) -> String {
    let (kept, missing): (Vec<&Record>, Vec<&Record>) =
        study.runs.iter().filter(|r| r.scene == scene).partition(|r| study.counts_time(r));
    match missing.len() {
        0 => String::new(),
        n => format!(
            "{n} of the {} runs were made on a busy machine and are missing from charts of time.",
            n + kept.len()
        ),
    }
}

/// A name as a part of a file name.
fn slug(name: &str) -> String {
    let letters = name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' });
    let words = letters.collect::<String>().split_whitespace().collect::<Vec<_>>().join("-");
    if words.is_empty() { "scene".to_owned() } else { words }
}

/// The name, with a number if it is taken.
pub fn unused(name: &str, taken: &mut HashSet<String>) -> String {
    let numbered = (2..).map(|number| format!("{name}-{number}"));
    let mut names = std::iter::once(name.to_owned()).chain(numbered);
    names.find(|name| taken.insert(name.clone())).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{record, records};
    use super::super::study::Options;
    use super::*;

    fn charts(records: Vec<Record>, options: &Options) -> Vec<Chart> {
        let study = Study::new(vec![records], options).unwrap();
        sections(&study).into_iter().flat_map(|s| s.charts).collect()
    }

    fn ids(charts: &[Chart]) -> Vec<&str> {
        charts.iter().map(|c| c.id.as_str()).collect()
    }

    #[test]
    fn every_kind_of_chart_is_made_with_a_unique_name() {
        let charts = charts(records(), &Options::default());
        let ids = ids(&charts);
        assert_eq!(ids.iter().collect::<HashSet<_>>().len(), charts.len());
        for id in [
            "fox-psnr-cpu-secs",
            "fox-grad-psnr-params",
            "fox-psnr-ltgs-tiny",
            "fox-psnr-rasterised-layers",
            "fox-grad-psnr-blended-layers",
            "fox-psnr-over-time-300-steps",
            "b-grad-psnr-over-steps-300-steps",
            "paired-psnr",
            "paired-cpu-secs",
        ] {
            assert!(ids.contains(&id), "{id}: {ids:?}");
        }
        assert!(charts.iter().all(|c| c.draw().is_some()));
    }

    #[test]
    fn runs_that_count_no_layers_have_no_charts_of_them() {
        let mut all = records();
        for run in &mut all {
            run.summary.as_mut().and_then(|s| s.as_object_mut()).unwrap().remove("layers_per_pixel");
        }
        let without = charts(all, &Options::default());
        assert!(ids(&without).contains(&"fox-psnr-params"));
        assert!(ids(&without).iter().all(|id| !id.contains("layers")));
    }

    #[test]
    fn curves_show_mean_and_range_of_the_seeds() {
        let charts = charts(records(), &Options::default());
        let chart = charts.iter().find(|c| c.id == "fox-psnr-over-steps-300-steps").unwrap();
        let curve = &chart.series[0];
        assert_eq!(curve.line.len(), 3);
        let (step, low, high) = curve.band[2];
        assert!(step == 300.0 && (low - 23.9).abs() < 1e-9 && (high - 26.3).abs() < 1e-9, "{low} {high}");
        let mean = curve.line[2].1;
        assert!((mean - 25.18).abs() < 1e-9, "{mean}");
    }

    #[test]
    fn noisy_runs_are_missing_only_from_charts_of_time() {
        let mut all = records();
        all.iter_mut().for_each(|r| r.noisy = true);
        let quiet = charts(all.clone(), &Options::default());
        let quiet = ids(&quiet);
        assert!(quiet.iter().all(|id| !id.contains("secs") && !id.contains("time")), "{quiet:?}");
        assert!(quiet.contains(&"fox-psnr-params"));
        let noisy = charts(all, &Options { include_noisy: true, ..Options::default() });
        assert!(ids(&noisy).contains(&"fox-psnr-cpu-secs"));
    }

    #[test]
    fn a_run_without_curve_or_figures_makes_no_chart_and_no_panic() {
        let mut bare = record(0, ("s", "v", "b"), 1, 20.0);
        bare.summary = Some(serde_json::json!({ "quality": null, "curve": [{ "step": "x" }, 3, {}] }));
        let sections = sections(&Study::new(vec![vec![bare]], &Options::default()).unwrap());
        assert!(sections.iter().all(|s| s.charts.is_empty()));
        assert!(sections[1].note.contains("eval-every="));
    }

    #[test]
    fn differences_are_coloured_where_they_are_decided() {
        let all = charts(records(), &Options::default());
        let paired = all.iter().find(|c| c.id == "paired-psnr").unwrap();
        assert_eq!(paired.y.rows[0], "=textured: +0.51 dB, n = 10");
        assert_eq!((paired.series.len(), paired.series[0].marks.len()), (1, 3));
        assert!(paired.series[0].marks[1].hover.ends_with("n = 5; better"));
        // A single pair has no interval and decides nothing, a single variant has no chart.
        let pair = vec![record(0, ("s", "a", "b"), 1, 20.0), record(1, ("s", "c", "b"), 1, 25.0)];
        let single = charts(pair.clone(), &Options::default());
        let series = &single.iter().find(|c| c.id == "paired-psnr").unwrap().series[0];
        assert_eq!((series.name.as_str(), series.marks[0].interval), ("not decided", None));
        let alone = charts(pair[..1].to_vec(), &Options::default());
        assert!(ids(&alone).iter().all(|id| !id.starts_with("paired")));
    }

    #[test]
    fn the_front_has_steps_and_no_dominated_mean() {
        let front = front(&[(2.0, 25.0), (1.0, 20.0), (3.0, 24.0)]);
        assert_eq!(front.line, [(1.0, 20.0), (2.0, 20.0), (2.0, 25.0)]);
    }

    #[test]
    fn file_names_are_plain_and_distinct() {
        let mut taken = HashSet::new();
        let slugs = ["Fox 1", "fox/1", "../..", "ü"].map(|n| unused(&slug(n), &mut taken));
        assert_eq!(slugs, ["fox-1", "fox-1-2", "scene", "scene-2"]);
    }
}
