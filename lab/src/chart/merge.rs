//! Merges the lines of several files of results into one list of distinct runs.

use crate::results::{self, Record};
use litetex_gs::Report;
use std::collections::HashMap;

/// The last lines of all keys, in the order of the matrices.
pub fn merged(files: Vec<Vec<Record>>, report: &mut Report) -> Vec<Record> {
    let ordered = files.into_iter().flat_map(|file| {
        let mut file = results::latest(file);
        file.sort_by_key(|r| r.cell);
        file
    });
    unambiguous(results::latest(ordered.collect()), report)
}

/// Distinct names in the order of their first use.
pub fn names(records: &[Record], of: fn(&Record) -> &String) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for record in records {
        if !names.contains(of(record)) {
            names.push(of(record).clone());
        }
    }
    names
}

/// Keeps the last of several runs with equal names and seed but different arguments or versions.
fn unambiguous(records: Vec<Record>, report: &mut Report) -> Vec<Record> {
    let mut last: HashMap<(String, String, String, u64), usize> = HashMap::new();
    for (i, r) in records.iter().enumerate() {
        last.insert((r.scene.clone(), r.variant.clone(), r.budget.clone(), r.seed), i);
    }
    let mut dropped = Vec::new();
    let mut kept = Vec::new();
    for (i, r) in records.into_iter().enumerate() {
        let name = (r.scene.clone(), r.variant.clone(), r.budget.clone(), r.seed);
        if last.get(&name) == Some(&i) { kept.push(r) } else { dropped.push(name) }
    }
    if let Some((scene, variant, budget, seed)) = dropped.first() {
        report.warn(
            "ambiguous-runs",
            dropped.len(),
            format!(
                "{} runs are ignored because a later one has the same names and seed but other arguments or another \
                 version; the first is {scene:?}, {variant:?}, {budget:?}, seed {seed}",
                dropped.len()
            ),
        );
    }
    kept
}
