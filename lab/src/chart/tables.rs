//! The tables of a study for people: results, paired differences, ablation, matched sizes, failures.

use super::cells::{difference_cell, difference_cells, group_cells, group_columns, signed, tone};
use super::compare::{Difference, compare_groups};
use super::measure::{Better, Measure};
use super::paired::{others, paired, paired_cells};
use super::scale::{Quantity, number};
use super::stats::Stats;
use super::study::{Group, Study};
use super::table::{Column, Table, TableCell, Tone};
use crate::results::Record;

/// Sizes within this ratio count as equal.
const MATCHED_RATIO: f64 = 1.02;

/// All tables, in the order of the page.
pub fn tables(study: &Study) -> Vec<Table> {
    let mut tables = vec![results(study)];
    if study.variants.len() > 1 {
        tables.extend([paired(study), paired_cells(study), ablation(study), matched(study)]);
    }
    if !study.failed.is_empty() {
        tables.push(failures(study));
    }
    tables
}

fn arrow(measure: &Measure) -> &'static str {
    match measure.better {
        Better::Higher => "↑",
        Better::Lower => "↓",
    }
}

fn head(measure: &Measure) -> String {
    if measure.is_time {
        return measure.unit.replace("seconds", "s");
    }
    let name = measure.title();
    if measure.quantity == Quantity::Bytes {
        format!("{}, MB", measure.name)
    } else if measure.is_cost {
        name
    } else {
        format!("{} {}", name.trim_start_matches("Test "), arrow(measure))
    }
}

fn results(study: &Study) -> Table {
    let costs = study.counts.iter().chain([&study.params, &study.time]).chain(&study.bytes);
    let measures: Vec<&Measure> = study.qualities.iter().chain(costs).collect();
    let mut columns = group_columns();
    columns.push(Column::numbers("Runs", &["runs".to_owned(), "failed".to_owned()]));
    for m in &measures {
        columns.push(Column::numbers(head(m), &[format!("{}_mean", m.id), format!("{}_sd", m.id)]));
    }
    let mut rows = Vec::new();
    for group in study.groups() {
        let failed = study
            .failed
            .iter()
            .filter(|r| r.scene == group.scene && r.variant == group.variant && r.budget == group.budget)
            .count();
        let n = group.runs.len();
        let text = if failed > 0 { format!("{n} ({failed} failed)") } else { n.to_string() };
        let tone = if failed > 0 { Tone::Bad } else { Tone::Plain };
        let mut row = group_cells(&group);
        row.push(TableCell::numbers(text, &[Some(n as f64), Some(failed as f64)]).toned(tone));
        row.extend(measures.iter().map(|m| mean_cell(study, &group, m)));
        rows.push(row);
    }
    let mut note =
        "Means over the seeds ± standard deviation. SSIM as the 3DGS family computes it (zero padding); \
                    FLIP is the mean error. Parameters: the floats of the model."
            .to_owned();
    if study.runs.iter().any(|r| r.noisy) {
        note += if study.include_noisy {
            " * Some runs were made on a busy machine; their times are included."
        } else {
            " * Some runs were made on a busy machine; their times are left out."
        };
    }
    Table { id: "results".to_owned(), title: "Results".to_owned(), note, columns, rows }
}

fn mean_cell(study: &Study, group: &Group<'_>, measure: &Measure) -> TableCell {
    let stats = study.stats(group, measure);
    let star = if measure.is_time && group.runs.iter().any(|r| r.noisy) { " *" } else { "" };
    let text = stats.map_or("–".to_owned(), |s| {
        // Bytes are shown in MB.
        let (unit, digits) =
            if measure.quantity == Quantity::Bytes { (1e6, 2) } else { (1.0, measure.digits) };
        let sd =
            s.sd.filter(|sd| *sd > 0.0)
                .map_or(String::new(), |sd| format!(" ± {}", number(sd / unit, digits)));
        number(s.mean / unit, digits) + &sd
    });
    TableCell::numbers(text + star, &[stats.map(|s| s.mean), stats.and_then(|s: Stats| s.sd)])
}

fn ablation(study: &Study) -> Table {
    let measures: Vec<&Measure> =
        study.qualities.iter().chain(&study.counts).chain([&study.params, &study.time]).collect();
    let mut columns = group_columns();
    for m in &measures {
        columns.push(Column::numbers(head(m), std::slice::from_ref(&m.id)));
        if !study.counts.contains(m) {
            columns.push(Column::numbers("Δ", &[format!("{}_difference", m.id)]));
        }
    }
    let mut rows = Vec::new();
    for group in study.groups() {
        let base = study.group(group.scene, &study.baseline, group.budget);
        let is_base = group.variant == study.baseline;
        let mut row = group_cells(&group);
        if is_base {
            row[2].text += " (baseline)";
        }
        for m in &measures {
            let stats = study.stats(&group, m);
            let text = stats.map_or("–".to_owned(), |s| number(s.mean, m.digits));
            row.push(TableCell::numbers(text, &[stats.map(|s| s.mean)]));
            if !study.counts.contains(m) {
                let d = compare_groups(study, &group, &base, m);
                let cell = if is_base {
                    TableCell::numbers("", &[None])
                } else {
                    difference_cell(&d, m).toned(tone(&d))
                };
                row.push(cell);
            }
        }
        rows.push(row);
    }
    let note = format!(
        "Δ: mean paired difference to {:?}, in per cent for costs; coloured where its 95 % interval excludes 0.",
        study.baseline
    );
    Table { id: "ablation".to_owned(), title: "Ablation".to_owned(), note, columns, rows }
}

/// The group of a variant whose size is nearest to that of a group of the baseline.
struct Match<'a> {
    group: Group<'a>,
    params: f64,
    /// Parameters over those of the baseline.
    ratio: f64,
}

impl Match<'_> {
    fn is_close(&self) -> bool {
        self.ratio.ln().abs() <= MATCHED_RATIO.ln()
    }
}

fn nearest<'a>(study: &'a Study, base: &Group<'a>, base_params: f64, variant: &'a str) -> Option<Match<'a>> {
    let candidates = study.budgets.iter().filter_map(|budget| {
        let group = study.group(base.scene, variant, budget);
        let params = study.stats(&group, &study.params)?.mean;
        let ratio = params / base_params;
        ratio.is_normal().then_some(Match { group, params, ratio })
    });
    // Where budgets are lengths, all sizes are alike; then the same budget is meant.
    let rank = |m: &Match<'_>| {
        let is_other = m.group.budget != base.budget;
        (is_other || !m.is_close(), m.ratio.ln().abs(), is_other)
    };
    candidates.min_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
    })
}

fn matched(study: &Study) -> Table {
    let mut columns: Vec<Column> = [
        ("scene", "scene"),
        ("baseline's budget", "baseline_budget"),
        ("variant", "variant"),
        ("its budget", "budget"),
    ]
    .map(|(n, k)| Column::names(n, k))
    .into();
    columns.push(Column::numbers("Parameters", &["params".to_owned()]));
    columns.push(Column::numbers("to the baseline", &["params_percent".to_owned()]));
    columns.push(Column::names("matched", "matched"));
    for m in &study.qualities[..2] {
        columns.push(Column::numbers(format!("Δ {}", m.name), &[format!("{}_difference", m.id)]));
        columns
            .push(Column::numbers("95 % interval", &[format!("{}_low95", m.id), format!("{}_high95", m.id)]));
        columns.push(Column::names("Verdict", &format!("{}_verdict", m.id)));
    }
    let mut rows = Vec::new();
    for scene in &study.scenes {
        for budget in &study.budgets {
            let base = study.group(scene, &study.baseline, budget);
            let params = study.stats(&base, &study.params).map(|s| s.mean).filter(|p| *p > 0.0);
            let Some(params) = params else { continue };
            for variant in others(study) {
                rows.extend(nearest(study, &base, params, variant).map(|m| matched_row(study, &base, &m)));
            }
        }
    }
    let note = format!(
        "For every budget of {:?}, the budget at which another variant has the nearest number of parameters. Sizes \
         within ±2\u{a0}% count as matched and are compared, paired by seed; others are not comparable.",
        study.baseline
    );
    Table { id: "matched".to_owned(), title: "Matched sizes".to_owned(), note, columns, rows }
}

fn matched_row(study: &Study, base: &Group<'_>, found: &Match<'_>) -> Vec<TableCell> {
    let group = &found.group;
    let mut row = [base.scene, base.budget, group.variant, group.budget].map(TableCell::name).to_vec();
    row.push(TableCell::numbers(number(found.params, 0), &[Some(found.params)]));
    let percent = 100.0 * (found.ratio - 1.0);
    row.push(TableCell::numbers(signed(percent, &study.params), &[Some(percent)]));
    let (text, tone) = if found.is_close() { ("yes", Tone::Plain) } else { ("no", Tone::Faint) };
    row.push(TableCell::name(text).toned(tone));
    for m in &study.qualities[..2] {
        let d = if found.is_close() { compare_groups(study, group, base, m) } else { Difference::of(&[], m) };
        let mut cells = difference_cells(&d, m);
        if !found.is_close() {
            cells[3] = TableCell::name("not comparable").toned(Tone::Faint);
        }
        row.extend(cells.into_iter().skip(1));
    }
    row
}

fn failures(study: &Study) -> Table {
    let mut columns = group_columns();
    columns.extend([Column::numbers("seed", &["seed".to_owned()]), Column::names("why", "error")]);
    let row = |r: &Record| {
        let mut row = [&r.scene, &r.budget, &r.variant].map(|n| TableCell::name(n)).to_vec();
        row.push(TableCell::numbers(r.seed.to_string(), &[Some(r.seed as f64)]));
        row.push(TableCell::name(r.error.as_deref().unwrap_or("no message")));
        row
    };
    let rows = study.failed.iter().map(row).collect();
    Table { id: "failed".to_owned(), title: "Failed runs".to_owned(), note: String::new(), columns, rows }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{record, records};
    use super::super::raw::raw_tables;
    use super::super::study::Options;
    use super::*;

    fn study(records: Vec<Record>) -> Study {
        Study::new(vec![records], &Options::default()).unwrap()
    }

    fn table(study: &Study, id: &str) -> Table {
        tables(study).into_iter().chain(raw_tables(study)).find(|t| t.id == id).unwrap()
    }

    #[test]
    fn rows_have_a_cell_for_each_column_and_a_value_for_each_key() {
        let mut all = records();
        all[3].status = crate::results::Status::Failed;
        let study = study(all);
        for t in tables(&study).into_iter().chain(raw_tables(&study)) {
            assert!(!t.rows.is_empty(), "{}", t.id);
            for row in &t.rows {
                assert_eq!(row.len(), t.columns.len(), "{}", t.id);
                for (cell, column) in row.iter().zip(&t.columns) {
                    assert_eq!(cell.values.len(), column.keys.len(), "{}: {}", t.id, column.name);
                }
            }
        }
    }

    #[test]
    fn tables_show_means_and_standard_deviations() {
        let markdown = table(&study(records()), "results").markdown();
        // 25 + mean of 0.9, -1.1, 0.4, -0.6, 1.3 and their standard deviation.
        assert!(markdown.contains("| fox | 300 steps | plain | 5 | 25.18 ± 1.01 |"), "{markdown}");
        assert!(markdown.contains("| 10,000 | 0 | 160,000 | 590,000 |"), "{markdown}");
        let csv = table(&study(records()), "runs").csv();
        assert_eq!(csv.lines().count(), 21);
    }

    #[test]
    fn the_baseline_is_the_first_variant_or_the_one_named() {
        let of =
            |options: &Options| table(&Study::new(vec![records()], options).unwrap(), "ablation").markdown();
        let first = of(&Options::default());
        assert!(first.contains("plain (baseline)") && first.contains("| +0.51 dB |"), "{first}");
        assert!(first.contains("| +40.7 % |"), "{first}");
        let named = of(&Options { baseline: Some("=textured".to_owned()), ..Options::default() });
        assert!(named.contains("=textured (baseline)") && named.contains("| −0.51 dB |"), "{named}");
        let unknown = Options { baseline: Some("x".to_owned()), ..Options::default() };
        let error = Study::new(vec![records()], &unknown).unwrap_err().to_string();
        assert!(error.contains("--baseline \"x\"") && error.contains("\"plain\""), "{error}");
    }

    #[test]
    fn sizes_are_matched_across_budgets() {
        let mut all = Vec::new();
        for seed in 1..=2 {
            for (budget, factor) in [("1x", 1), ("2x", 2)] {
                for variant in ["plain", "full"] {
                    let mut r = record(all.len(), ("s", variant, budget), seed, 20.0 + f64::from(factor));
                    // "full" is as large at 1x as "plain" is at 2x.
                    let params = 1000 * factor * if variant == "full" { 2 } else { 1 }
                        + i32::from(variant == "full") * 10;
                    r.summary.as_mut().unwrap()["size"]["params"] = params.into();
                    all.push(r);
                }
            }
        }
        let csv = table(&study(all), "matched").csv();
        let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|l| l.split(',').collect()).collect();
        assert_eq!(rows[0][..4], ["s", "1x", "full", "1x"]);
        assert_eq!((rows[0][6], rows[0][7]), ("no", ""));
        assert_eq!(rows[1][..4], ["s", "2x", "full", "1x"]);
        assert_eq!((rows[1][6], rows[1][7]), ("yes", "-1"));
        // Sizes that are alike in all budgets: the same budget is compared, even where another is as near.
        let mut lengths = Vec::new();
        for budget in ["short", "long"] {
            for variant in ["plain", "full"] {
                let mut r = record(lengths.len(), ("s", variant, budget), 1, 20.0);
                r.summary.as_mut().unwrap()["size"]["params"] =
                    if variant == "full" { 1500 } else { 1000 }.into();
                lengths.push(r);
            }
        }
        let of = |records: Vec<Record>| -> Vec<(String, String, String)> {
            let csv = table(&study(records), "matched").csv();
            let field = |l: &str, i: usize| l.split(',').nth(i).unwrap().to_owned();
            csv.lines().skip(1).map(|l| (field(l, 1), field(l, 3), field(l, 6))).collect()
        };
        let budgets =
            |matched: &str| ["short", "long"].map(|b| (b.to_owned(), b.to_owned(), matched.to_owned()));
        assert_eq!(of(lengths.clone()), budgets("no"));
        lengths.iter_mut().for_each(|r| r.summary.as_mut().unwrap()["size"]["params"] = 1000.into());
        // Negative control: not even a little nearer in the other budget.
        lengths[1].summary.as_mut().unwrap()["size"]["params"] = 1001.into();
        assert_eq!(of(lengths), budgets("yes"));
    }

    #[test]
    fn zero_has_no_sign() {
        let study = study(records());
        let psnr = &study.qualities[0];
        assert_eq!(signed(-0.001, psnr), "0.00 dB");
        assert_eq!(signed(0.512, psnr), "+0.51 dB");
        assert_eq!(signed(-12.345, &study.params), "−12.3 %");
    }
}
