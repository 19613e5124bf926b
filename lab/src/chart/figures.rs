//! The charts of a study: quality against cost, Pareto fronts, quality during training.

use super::curves::curves;
use super::measure::Measure;
use super::plot::{Axis, Chart, Mark, Quantity, Series, Spacing};
use super::scale::{counted, number};
use super::section::{Section, axis, missing_times, slug};
use super::stats::{Stats, pareto_front};
use super::study::{Group, Study};
use crate::results::Record;
use std::collections::HashSet;

/// All sections, in the order of the page.
pub fn sections(study: &Study) -> Vec<Section> {
    let mut names = HashSet::new();
    let scenes: Vec<(&String, String)> = study.scenes.iter().map(|s| (s, slug(s, &mut names))).collect();
    let mut sections = Vec::new();
    for (scene, slug) in &scenes {
        sections.push(quality_by_cost(study, scene, slug));
    }
    for (scene, slug) in &scenes {
        sections.push(front(study, scene, slug));
    }
    for (scene, slug) in &scenes {
        sections.push(curves(study, scene, slug));
    }
    sections
}

fn quality_by_cost(study: &Study, scene: &str, slug: &str) -> Section {
    let costs: Vec<&Measure> = [&study.time, &study.params].into_iter().chain(&study.bytes).collect();
    let mut charts = Vec::new();
    for cost in costs {
        for quality in &study.qualities[..2] {
            let series: Vec<Series> =
                study.variants.iter().filter_map(|v| cost_series(study, scene, v, cost, quality)).collect();
            if !series.is_empty() {
                charts.push(Chart {
                    id: format!("{slug}-{}-{}", quality.id, cost.id).replace('_', "-"),
                    title: format!("{scene}: {} by {}", quality.name, lower(&cost.name)),
                    x: axis(cost),
                    y: Axis { name: quality.title(), spacing: Spacing::Linear, quantity: Quantity::Plain },
                    series,
                    front: Vec::new(),
                    events: Vec::new(),
                });
            }
        }
    }
    let several = if study.budgets.len() > 1 { "; lines connect the budgets of a variant" } else { "" };
    let note = format!(
        "Large markers are means over the seeds, small ones single runs{several}. {}",
        missing_times(study, scene)
    );
    Section { title: format!("Quality by cost: {scene}"), note: note.trim_end().to_owned(), charts }
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
        let Some((x, y, runs)) = means(study, &group, cost, quality) else { continue };
        let label = (study.budgets.len() > 1).then(|| budget.clone());
        let hover = format!(
            "{variant}, {budget}: {} at {} ({})",
            mean_and_sd(&y, quality),
            amount(x.mean, cost),
            counted(y.n, "run")
        );
        series.marks.push(Mark { at: (x.mean, y.mean), hover, label, grey: false });
        if runs.len() > 1 {
            series.dots.extend(runs.iter().map(|&(seed, at)| Mark {
                at,
                hover: format!(
                    "{variant}, {budget}, seed {seed}: {} at {}",
                    amount(at.1, quality),
                    amount(at.0, cost)
                ),
                label: None,
                grey: false,
            }));
        }
    }
    series.line = series.marks.iter().map(|m| m.at).collect();
    series.line.sort_by(|a, b| a.0.total_cmp(&b.0));
    (!series.marks.is_empty()).then_some(series)
}

/// Means of cost and quality over the runs that have both, and these runs.
type Means = (Stats, Stats, Vec<(u64, (f64, f64))>);

fn means(study: &Study, group: &Group<'_>, cost: &Measure, quality: &Measure) -> Option<Means> {
    let both = |r: &&Record| Some((r.seed, (study.value(r, cost)?, study.value(r, quality)?)));
    let runs: Vec<(u64, (f64, f64))> = group.runs.iter().filter_map(both).collect();
    let [x, y] = [0, 1].map(|i| {
        Stats::of(&runs.iter().map(|(_, at)| if i == 0 { at.0 } else { at.1 }).collect::<Vec<f64>>())
    });
    Some((x?, y?, runs))
}

fn front(study: &Study, scene: &str, slug: &str) -> Section {
    let quality = &study.qualities[0];
    let mut charts = Vec::new();
    for cost in [&study.params, &study.time] {
        let mut points = Vec::new();
        for variant in &study.variants {
            for budget in &study.budgets {
                if let Some((x, y, _)) = means(study, &study.group(scene, variant, budget), cost, quality) {
                    points.push((variant, budget, (x.mean, y.mean)));
                }
            }
        }
        let at: Vec<(f64, f64)> = points.iter().map(|p| p.2).collect();
        let is_front = pareto_front(&at);
        let mut series: Vec<Series> = Vec::new();
        for (&(variant, budget, at), &in_front) in points.iter().zip(&is_front) {
            let name = if study.budgets.len() > 1 { format!("{variant}, {budget}") } else { variant.clone() };
            let state = if in_front { "on the front" } else { "dominated" };
            let hover = format!("{name}: {} at {}; {state}", amount(at.1, quality), amount(at.0, cost));
            let mark = Mark { at, hover, label: in_front.then_some(name), grey: !in_front };
            match series.iter_mut().find(|s| s.name == *variant) {
                Some(s) => s.marks.push(mark),
                None => series.push(Series {
                    name: variant.clone(),
                    look: study.look(variant),
                    marks: vec![mark],
                    ..Series::default()
                }),
            }
        }
        if points.len() < 2 {
            continue;
        }
        let mut front: Vec<(f64, f64)> =
            at.iter().zip(&is_front).filter(|(_, f)| **f).map(|(p, _)| *p).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        charts.push(Chart {
            id: format!("{slug}-pareto-{}", cost.id).replace('_', "-"),
            title: format!("{scene}: Pareto front of PSNR and {}", lower(&cost.name)),
            x: axis(cost),
            y: Axis { name: quality.title(), spacing: Spacing::Linear, quantity: Quantity::Plain },
            series,
            front,
            events: Vec::new(),
        });
    }
    let note = format!(
        "Means over the seeds. Grey points are dominated: another one costs no more and is at least as good. {}",
        missing_times(study, scene)
    );
    Section { title: format!("Pareto front: {scene}"), note: note.trim_end().to_owned(), charts }
}

fn lower(name: &str) -> String {
    let mut chars = name.chars();
    chars.next().map_or(String::new(), |c| c.to_lowercase().collect::<String>() + chars.as_str())
}

/// A value with its unit: "26.12 dB", "830,000 parameters".
pub fn amount(value: f64, measure: &Measure) -> String {
    let unit = match measure.unit {
        "" if measure.is_cost => format!(" {}", lower(&measure.name)),
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    number(value, measure.digits) + &unit
}

fn mean_and_sd(stats: &Stats, measure: &Measure) -> String {
    let sd = stats.sd.map_or(String::new(), |sd| format!(" (sd {sd:.*})", measure.digits));
    amount(stats.mean, measure) + &sd
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{record, records};
    use super::super::study::Options;
    use super::*;

    fn study(records: Vec<Record>) -> Study {
        Study::new(vec![records], &Options::default()).unwrap()
    }

    #[test]
    fn every_kind_of_chart_is_made_with_a_unique_name() {
        let sections = sections(&study(records()));
        let charts: Vec<&Chart> = sections.iter().flat_map(|s| &s.charts).collect();
        let ids: HashSet<&str> = charts.iter().map(|c| c.id.as_str()).collect();
        assert_eq!(ids.len(), charts.len());
        for id in [
            "fox-psnr-cpu-secs",
            "fox-grad-psnr-params",
            "fox-psnr-ltgs-tiny",
            "fox-pareto-params",
            "b-pareto-cpu-secs",
            "fox-psnr-over-time-300-steps",
            "b-grad-psnr-over-steps-300-steps",
        ] {
            assert!(ids.contains(id), "{id}: {ids:?}");
        }
        assert!(charts.iter().all(|c| c.draw().is_some()));
    }

    #[test]
    fn curves_show_mean_and_range_of_the_seeds() {
        let study = study(records());
        let sections = sections(&study);
        let curve = &sections
            .iter()
            .flat_map(|s| &s.charts)
            .find(|c| c.id == "fox-psnr-over-steps-300-steps")
            .unwrap()
            .series[0];
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
        let ids = |study: &Study| -> Vec<String> {
            sections(study).into_iter().flat_map(|s| s.charts).map(|c| c.id).collect()
        };
        let quiet = ids(&study(all.clone()));
        assert!(quiet.iter().all(|id| !id.contains("secs") && !id.contains("time")), "{quiet:?}");
        assert!(quiet.iter().any(|id| id == "fox-psnr-params"));
        let options = Options { include_noisy: true, ..Options::default() };
        assert!(ids(&Study::new(vec![all], &options).unwrap()).iter().any(|id| id == "fox-psnr-cpu-secs"));
    }

    #[test]
    fn a_run_without_curve_or_figures_makes_no_chart_and_no_panic() {
        let mut bare = record(0, ("s", "v", "b"), 1, 20.0);
        bare.summary = Some(serde_json::json!({ "quality": null, "curve": [{ "step": "x" }, 3, {}] }));
        let sections = sections(&study(vec![bare]));
        assert!(sections.iter().all(|s| s.charts.is_empty()));
        assert!(sections[2].note.contains("--eval-every"));
    }

    #[test]
    fn file_names_are_plain_and_distinct() {
        let mut taken = HashSet::new();
        let slugs = ["Fox 1", "fox/1", "../..", "ü"].map(|n| slug(n, &mut taken));
        assert_eq!(slugs, ["fox-1", "fox-1-2", "scene", "scene-2"]);
    }
}
