//! The tables of paired differences: means, intervals, conclusions.

use super::cells::{difference_cells, difference_columns, group_cells, group_columns};
use super::compare::{CLAIM_PAIRS_MIN, Scope, compare};
use super::measure::Measure;
use super::study::Study;
use super::table::{Column, Table, TableCell};

fn compared(study: &Study) -> Vec<&Measure> {
    study.qualities.iter().chain([&study.params, &study.time]).collect()
}

/// Variants besides the baseline.
pub fn others(study: &Study) -> impl Iterator<Item = &String> {
    study.variants.iter().filter(|v| **v != study.baseline)
}

/// Differences over all pairs, and over scenes.
pub fn paired(study: &Study) -> Table {
    let mut columns = vec![
        Column::names("variant", "variant"),
        Column::names("measure", "measure"),
        Column::names("pairs are", "scope"),
    ];
    columns.extend(difference_columns());
    let mut rows = Vec::new();
    for variant in others(study) {
        for measure in compared(study) {
            let mut row = |scope, name: &str| {
                let mut cells =
                    vec![TableCell::name(variant), TableCell::name(&measure.name), TableCell::name(name)];
                cells.extend(difference_cells(&compare(study, variant, scope, measure), measure));
                rows.push(cells);
            };
            row(Scope::AllPairs, "runs");
            if study.scenes.len() > 1 {
                row(Scope::SceneMeans, "scenes");
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
    Table { id: "paired".to_owned(), title: "Paired differences".to_owned(), note, columns, rows }
}

/// Differences by scene and budget.
pub fn paired_cells(study: &Study) -> Table {
    let mut columns = group_columns();
    columns.push(Column::names("measure", "measure"));
    columns.extend(difference_columns());
    let mut rows = Vec::new();
    for scene in &study.scenes {
        for budget in &study.budgets {
            for variant in others(study) {
                let group = study.group(scene, variant, budget);
                if group.runs.is_empty() {
                    continue;
                }
                for measure in compared(study) {
                    let mut row = group_cells(&group);
                    row.push(TableCell::name(&measure.name));
                    row.extend(difference_cells(
                        &compare(study, variant, Scope::SceneBudget(scene, budget), measure),
                        measure,
                    ));
                    rows.push(row);
                }
            }
        }
    }
    let note = format!("Variant minus {:?}, paired by seed.", study.baseline);
    let title = "Paired differences by scene and budget".to_owned();
    Table { id: "paired-cells".to_owned(), title, note, columns, rows }
}
