//! The tables of a study for programs: every run and every point of the curves, at full precision.

use super::cells::group_columns;
use super::study::{Study, device};
use super::table::{Column, Table, TableCell};
use crate::results::Record;

/// The tables of runs and of curves.
pub fn raw_tables(study: &Study) -> Vec<Table> {
    vec![runs(study), curves(study)]
}

fn runs(study: &Study) -> Table {
    let costs = study.counts.iter().chain([&study.params]).chain(&study.bytes);
    let mut measures: Vec<(String, String)> =
        study.qualities.iter().chain(costs).map(|m| (m.id.clone(), m.pointer.clone())).collect();
    for (key, pointer) in [
        ("ssim_valid", "/quality/ssim_valid"),
        ("train_cpu_secs", "/time/train_cpu_secs"),
        ("train_wall_secs", "/time/train_wall_secs"),
        ("total_wall_secs", "/time/total_wall_secs"),
        ("fps_median", "/fps/median"),
        ("steps", "/steps"),
        ("memory_peak_bytes", "/memory_peak_bytes"),
    ] {
        measures.push((key.to_owned(), pointer.to_owned()));
    }
    let mut columns = group_columns();
    columns.push(Column::numbers("seed", &["seed".to_owned()]));
    columns.extend(["noisy", "device", "cpu", "version", "utc"].map(|n| Column::names(n, n)));
    columns.extend(measures.iter().map(|(key, _)| Column::numbers(key.as_str(), std::slice::from_ref(key))));
    let row = |r: &Record| {
        let mut row = [&r.scene, &r.budget, &r.variant].map(|n| TableCell::name(n)).to_vec();
        row.push(TableCell::name(&r.seed.to_string()));
        row.extend(
            [&r.noisy.to_string(), device(r), &r.hardware.cpu, &r.version, &r.utc].map(TableCell::name),
        );
        row.extend(measures.iter().map(|(_, pointer)| TableCell::numbers("", &[r.number(pointer)])));
        row
    };
    let rows = study.runs.iter().map(row).collect();
    Table { id: "runs".to_owned(), title: "Runs".to_owned(), note: String::new(), columns, rows }
}

fn curves(study: &Study) -> Table {
    let mut columns = group_columns();
    columns.push(Column::numbers("seed", &["seed".to_owned()]));
    let keys = ["step", "wall_secs", "cpu_secs", "psnr_test", "grad_psnr_test", "splats", "texels"];
    columns.extend(keys.map(|k| Column::numbers(k, &[k.to_owned()])));
    let mut rows = Vec::new();
    for r in &study.runs {
        let points = r.summary.as_ref().and_then(|s| s.get("curve")?.as_array());
        for point in points.into_iter().flatten() {
            let mut row = [&r.scene, &r.budget, &r.variant].map(|n| TableCell::name(n)).to_vec();
            row.push(TableCell::name(&r.seed.to_string()));
            row.extend(
                keys.map(|k| TableCell::numbers("", &[point.get(k).and_then(serde_json::Value::as_f64)])),
            );
            rows.push(row);
        }
    }
    Table { id: "curves".to_owned(), title: "Curves".to_owned(), note: String::new(), columns, rows }
}
