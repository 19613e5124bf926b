//! The tables of a study: results, paired differences and failures for people; every run and every point of the curves, at
//! full precision, for programs.

use super::compare::{CLAIM_PAIRS_MIN, Conclusion, Difference, Scope, compare};
use super::measure::Measure;
use super::plot::Quantity;
use super::scale::number;
use super::study::{Group, Study, device};
use super::table::{Column, Table, TableCell, Tone};
use crate::results::Record;

/// The tables for people, in the order of the page.
pub fn tables(study: &Study) -> Vec<Table> {
    let mut tables = vec![results(study, &study.bytes)];
    if study.variants.len() > 1 {
        tables.push(paired(study));
    }
    if !study.failed.is_empty() {
        tables.push(failures(study));
    }
    tables
}

/// The tables of runs and of curves.
pub fn raw_tables(study: &Study) -> Vec<Table> {
    vec![runs(study), curves(study)]
}

/// Scene, budget and variant.
fn group_columns() -> Vec<Column> {
    ["scene", "budget", "variant"].map(|n| Column::names(n, n)).into()
}

/// Columns for [`run_cells`].
fn run_columns() -> Vec<Column> {
    let mut columns = group_columns();
    columns.push(Column::numbers("seed", &["seed"]));
    columns
}

/// Scene, budget, variant and seed of a run.
fn run_cells(r: &Record) -> Vec<TableCell> {
    [&r.scene, &r.budget, &r.variant, &r.seed.to_string()].map(|n| TableCell::name(n)).into()
}

fn head(measure: &Measure) -> String {
    if measure.is_time {
        measure.unit.replace("seconds", "s")
    } else if measure.quantity == Quantity::Bytes {
        format!("{}, MB", measure.name)
    } else if measure.is_cost {
        measure.title()
    } else {
        let arrow = if measure.is_gain { "↑" } else { "↓" };
        format!("{} {arrow}", measure.title().trim_start_matches("Test "))
    }
}

/// Means over the seeds, of these sizes in bytes among others.
pub fn results(study: &Study, bytes: &[Measure]) -> Table {
    let costs = study.counts.iter().chain([&study.params, &study.time]).chain(bytes).chain(&study.layers);
    let measures: Vec<&Measure> = study.qualities.iter().chain(costs).collect();
    let mut columns = group_columns();
    columns.push(Column::numbers("Runs", &["runs", "failed"]));
    let of_measure =
        |m: &&Measure| Column::numbers(head(m), &[&format!("{}_mean", m.id), &format!("{}_sd", m.id)]);
    columns.extend(measures.iter().map(of_measure));
    let row = |group: Group<'_>| {
        let (n, failed) = (group.runs.len(), group.failed);
        let text = if failed > 0 { format!("{n} ({failed} failed)") } else { n.to_string() };
        let tone = if failed > 0 { Tone::Bad } else { Tone::Plain };
        let mut row = [group.scene, group.budget, group.variant].map(TableCell::name).to_vec();
        row.push(TableCell::numbers(text, &[Some(n as f64), Some(failed as f64)]).toned(tone));
        row.extend(measures.iter().map(|m| mean_cell(study, &group, m)));
        row
    };
    let rows = study.groups().into_iter().map(row).collect();
    let mut note =
        "Means over the seeds ± standard deviation. SSIM as the 3DGS family computes it (zero padding); \
                    FLIP is the mean error. Parameters: the floats of the model."
            .to_owned();
    if study.runs.iter().any(|r| r.noisy) {
        let times = if study.include_noisy { "included" } else { "left out" };
        note += &format!(" * Some runs were made on a busy machine; their times are {times}.");
    }
    Table::new("results", "Results", note, columns, rows)
}

fn mean_cell(study: &Study, group: &Group<'_>, measure: &Measure) -> TableCell {
    let stats = study.stats(group, measure);
    let sd = stats.and_then(|s| s.sd);
    let star = if measure.is_time && group.runs.iter().any(|r| r.noisy) { " *" } else { "" };
    let text = stats.map_or("–".to_owned(), |s| {
        // Bytes are shown in MB.
        let (unit, digits) =
            if measure.quantity == Quantity::Bytes { (1e6, 2) } else { (1.0, measure.digits) };
        let spread = sd.filter(|sd| *sd > 0.0).map(|sd| format!(" ± {}", number(sd / unit, digits)));
        number(s.mean / unit, digits) + &spread.unwrap_or_default()
    });
    TableCell::numbers(text + star, &[stats.map(|s| s.mean), sd])
}

/// Differences to the baseline: over all pairs, over scenes, and by scene and budget.
fn paired(study: &Study) -> Table {
    let columns = vec![
        Column::names("variant", "variant"),
        Column::names("measure", "measure"),
        Column::names("pairs are", "scope"),
        Column::names("scene", "scene"),
        Column::names("budget", "budget"),
        Column::numbers("Pairs", &["pairs"]),
        Column::numbers("Mean difference", &["difference"]),
        Column::numbers("95 % interval", &["low95", "high95"]),
        Column::names("Conclusion", "verdict"),
    ];
    let mut rows = Vec::new();
    for variant in study.others() {
        for measure in study.qualities.iter().chain([&study.params, &study.time]).chain(&study.layers) {
            for scope in Scope::all(study) {
                if let Scope::SceneBudget(scene, budget) = scope
                    && study.group(scene, variant, budget).runs.is_empty()
                {
                    continue;
                }
                let found = compare(study, variant, scope, measure);
                let (pairs, scene, budget) = match scope {
                    Scope::AllPairs => ("runs", "all", "all"),
                    Scope::SceneMeans => ("scenes", "all", "all"),
                    Scope::SceneBudget(scene, budget) => ("runs", scene, budget),
                };
                let mut row = [variant, &measure.name, pairs, scene, budget].map(TableCell::name).to_vec();
                row.extend(difference_cells(&found, measure));
                rows.push(row);
            }
        }
    }
    let note = format!(
        "Variant minus {:?}; runs are paired by scene, seed and budget, costs compared as ratios. Intervals are \
         Student's t at 95\u{a0}%; \"better\" and \"worse\" require an interval that excludes 0, and a claim requires \
         {CLAIM_PAIRS_MIN} pairs. \"scenes\": every scene counts once, with the mean of its pairs; only this row supports \
         conclusions about scenes that were not measured. Intervals are not corrected for multiple comparisons: of \
         20 comparisons without any effect, one excludes 0.",
        study.baseline
    );
    Table::new("paired", "Paired differences", note, columns, rows)
}

/// Number of pairs, mean difference, interval, conclusion.
fn difference_cells(d: &Difference, measure: &Measure) -> [TableCell; 4] {
    let interval = d.interval();
    let text = match interval {
        Some((low, high)) => format!("{} to {}", measure.signed(low), measure.signed(high)),
        None if d.n() == 1 => "none: 1 pair".to_owned(),
        None => "–".to_owned(),
    };
    let tone = match d.conclusion {
        Conclusion::Better => Tone::Good,
        Conclusion::Worse => Tone::Bad,
        _ => Tone::Faint,
    };
    let mean = d.mean().map_or("–".to_owned(), |x| measure.signed(x));
    [
        TableCell::numbers(d.n().to_string(), &[Some(d.n() as f64)]),
        TableCell::numbers(mean, &[d.mean()]),
        TableCell::numbers(text, &[interval.map(|i| i.0), interval.map(|i| i.1)]),
        TableCell::name(&d.words()).toned(tone),
    ]
}

fn failures(study: &Study) -> Table {
    let mut columns = run_columns();
    columns.push(Column::names("why", "error"));
    let row = |r: &Record| {
        let mut row = run_cells(r);
        row.push(TableCell::name(r.error.as_deref().unwrap_or("no message")));
        row
    };
    Table::new("failed", "Failed runs", "", columns, study.failed.iter().map(row).collect())
}

fn runs(study: &Study) -> Table {
    let costs = study.counts.iter().chain([&study.params]).chain(&study.bytes).chain(&study.layers);
    let measures = study.qualities.iter().chain(costs).map(|m| (&*m.id, &*m.pointer));
    let figures: Vec<(&str, &str)> = measures
        .chain([
            ("ssim_valid", "/quality/ssim_valid"),
            ("train_cpu_secs", "/time/train_cpu_secs"),
            ("train_wall_secs", "/time/train_wall_secs"),
            ("total_wall_secs", "/time/total_wall_secs"),
            ("fps_median", "/fps/median"),
            ("steps", "/steps"),
            ("memory_peak_bytes", "/memory_peak_bytes"),
        ])
        .collect();
    let mut columns = run_columns();
    columns.extend(["noisy", "device", "cpu", "version", "utc"].map(|n| Column::names(n, n)));
    columns.extend(figures.iter().map(|(key, _)| Column::numbers(*key, &[key])));
    let row = |r: &Record| {
        let mut row = run_cells(r);
        let facts = [&r.noisy.to_string(), device(r), &r.hardware.cpu, &r.version, &r.utc];
        row.extend(facts.map(TableCell::name));
        row.extend(figures.iter().map(|(_, pointer)| TableCell::numbers("", &[r.number(pointer)])));
        row
    };
    Table::new("runs", "Runs", "", columns, study.runs.iter().map(row).collect())
}

fn curves(study: &Study) -> Table {
    let keys = ["step", "wall_secs", "cpu_secs", "psnr_test", "grad_psnr_test", "splats", "texels"];
    let mut columns = run_columns();
    columns.extend(keys.map(|key| Column::numbers(key, &[key])));
    let mut rows = Vec::new();
    for r in &study.runs {
        let count = r.value("/curve").and_then(|curve| curve.as_array()).map_or(0, Vec::len);
        for i in 0..count {
            let mut row = run_cells(r);
            row.extend(keys.map(|key| TableCell::numbers("", &[r.number(&format!("/curve/{i}/{key}"))])));
            rows.push(row);
        }
    }
    Table::new("curves", "Curves", "", columns, rows)
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::records;
    use super::super::study::Options;
    use super::*;

    fn study(records: Vec<Record>, baseline: Option<&str>) -> litetex_gs::Result<Study> {
        let baseline = baseline.map(ToOwned::to_owned);
        Study::new(vec![records], &Options { baseline, ..Options::default() })
    }

    fn table(study: &Study, id: &str) -> Table {
        tables(study).into_iter().chain(raw_tables(study)).find(|t| t.id == id).unwrap()
    }

    #[test]
    fn rows_have_a_cell_for_each_column_and_a_value_for_each_key() {
        let mut all = records();
        all[3].status = crate::results::Status::Failed;
        let study = study(all, None).unwrap();
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
        let study = study(records(), None).unwrap();
        let markdown = table(&study, "results").markdown();
        // 25 + mean of 0.9, -1.1, 0.4, -0.6, 1.3 and their standard deviation.
        assert!(markdown.contains("| fox | 300 steps | plain | 5 | 25.18 ± 1.01 |"), "{markdown}");
        assert!(markdown.contains("| 10,000 | 0 | 160,000 | 590,000 |"), "{markdown}");
        assert_eq!(table(&study, "runs").csv().lines().count(), 21);
        assert_eq!(table(&study, "curves").csv().lines().count(), 61);
    }

    #[test]
    fn the_baseline_is_the_first_variant_or_the_one_named() {
        let first = table(&study(records(), None).unwrap(), "paired").markdown();
        let psnr = "Test PSNR | runs | all | all | 10 |";
        assert!(first.contains(&format!("| =textured | {psnr} +0.51 dB |")), "{first}");
        assert!(first.contains("| Parameters | scenes | all | all | 2 | +40.7 % |"), "{first}");
        assert!(first.contains("| Test PSNR | runs | fox | 300 steps | 5 | +0.51 dB |"), "{first}");
        let named = table(&study(records(), Some("=textured")).unwrap(), "paired").markdown();
        assert!(named.contains(&format!("| plain | {psnr} −0.51 dB |")), "{named}");
        let error = study(records(), Some("x")).unwrap_err().to_string();
        assert!(error.contains("--baseline \"x\"") && error.contains("\"plain\""), "{error}");
    }
}
