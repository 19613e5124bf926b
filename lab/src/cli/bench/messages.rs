//! Messages of a benchmark: a line per finished run, the list of runs, the table at the end.

use litetex_gs::console::{Log, Output, columns};
use litetex_gs::text::{format_count, format_duration};
use litetex_gs::{Report, Result};
use litetex_lab::chart::{Case, checks_markdown};
use litetex_lab::matrix::{Cell, Matrix};
use litetex_lab::results::{Record, Status};
use serde_json::json;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// Names that repetitions share.
type Name<'a> = (&'a str, &'a str, &'a str);

/// Reports a finished run.
pub fn finished(log: &Log, record: &Record, done: usize, all: usize, secs_left: f64) {
    let name = format!("{} {} {} seed {}", record.scene, record.variant, record.budget, record.seed);
    let what = match (&record.status, &record.error) {
        (Status::Failed, error) => format!("FAILED: {}", error.as_deref().unwrap_or("no message")),
        (Status::Ok, _) => {
            let decibels =
                |pointer| record.number(pointer).map_or("no test views".to_owned(), |x| format!("{x:.2} dB"));
            let count = |pointer| format_count(record.number(pointer).unwrap_or(0.0) as u64);
            format!(
                "{}, gradients {}; {} splats, {} texels; {} CPU{}",
                decibels("/quality/psnr"),
                decibels("/quality/grad_psnr"),
                count("/size/splats"),
                count("/size/texels"),
                format_duration(record.number("/time/train_cpu_secs").unwrap_or(0.0)),
                if record.noisy { " (noisy)" } else { "" }
            )
        }
    };
    let rest =
        if done < all { format!("; about {} left", format_duration(secs_left)) } else { String::new() };
    let fields = json!({ "done": done, "all": all, "scene": record.scene, "variant": record.variant,
        "budget": record.budget, "seed": record.seed, "status": record.status, "error": record.error,
        "psnr": record.number("/quality/psnr"), "noisy": record.noisy, "secs_left": secs_left });
    log.event("run", &format!("[{done}/{all}] {name}: {what}{rest}"), fields);
}

/// Warns if results come from another build of the program than `build`: finished and new runs may then differ by more
/// than their arguments.
pub fn other_builds(known: &[Record], build: &str, file: &Path) -> Report {
    let others: Vec<&str> = known.iter().map(|r| r.build.as_str()).filter(|b| *b != build).collect();
    let mut report = Report::default();
    if !(others.is_empty() || build.is_empty()) {
        let names: BTreeSet<&str> = others.iter().map(|b| if b.is_empty() { "unknown" } else { b }).collect();
        report.warn(
            "other-builds",
            others.len(),
            format!(
                "{}: {} of {} runs were made by another build of the program ({}) than this one ({build}) and are not \
                 repeated; use another folder, or --force, to make all of them with one build",
                file.display(),
                others.len(),
                known.len(),
                names.into_iter().collect::<Vec<_>>().join(", ")
            ),
        );
    }
    report
}

/// Lists the runs, with the time that unfinished ones will take as far as finished ones tell.
pub fn list(cells: &[Cell], left: &[&Cell], known: &[Record]) -> Output {
    let mut secs: HashMap<Name<'_>, (f64, f64)> = HashMap::new();
    for record in known {
        if let (Status::Ok, Some(wall)) = (record.status, record.wall_secs) {
            let sum = secs.entry((&record.scene, &record.variant, &record.budget)).or_default();
            *sum = (sum.0 + wall, sum.1 + 1.0);
        }
    }
    let mut total = Some(0.0);
    let mut rows = Vec::new();
    for cell in cells {
        let is_left = left.iter().any(|l| l.key == cell.key);
        let mean = secs.get(&(&*cell.scene, &*cell.variant, &*cell.budget)).map(|(sum, n)| sum / n);
        if is_left {
            total = total.zip(mean).map(|(t, m)| t + m);
        }
        let failed = known.iter().any(|r| r.key == cell.key && r.status == Status::Failed);
        let state = match (is_left, failed, mean) {
            (false, true, _) => "failed".to_owned(),
            (false, false, _) => "done".to_owned(),
            (true, _, Some(mean)) => format!("about {}", format_duration(mean)),
            (true, _, None) => "-".to_owned(),
        };
        let row =
            [&cell.scene, &cell.variant, &cell.budget, &cell.seed.to_string(), &state, &cell.args.join(" ")];
        rows.push(row.map(ToOwned::to_owned).into());
    }
    let time = match total {
        Some(total) if !left.is_empty() => format!(", about {} one at a time", format_duration(total)),
        _ => String::new(),
    };
    let table = columns(&["scene", "variant", "budget", "seed", "time", "arguments"], &rows);
    let text = format!("{table}{} of {} runs left{time}\n", left.len(), cells.len());
    Output::new(
        "litetex-bench/1",
        json!({ "runs": cells.len(), "left": left.len(), "secs_left": total }),
        text,
    )
}

/// Means over the seeds.
pub fn table(records: &[&Record]) -> String {
    let mut groups: Vec<(Name<'_>, Vec<&Record>)> = Vec::new();
    for record in records {
        let name = (&*record.scene, &*record.budget, &*record.variant);
        match groups.iter_mut().find(|(n, _)| *n == name) {
            Some((_, members)) => members.push(record),
            None => groups.push((name, vec![record])),
        }
    }
    let rows: Vec<Vec<String>> = groups
        .iter()
        .map(|((scene, budget, variant), members)| {
            let mean = |pointer| {
                let all: Vec<f64> = members.iter().filter_map(|r| r.number(pointer)).collect();
                (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
            };
            let text =
                |pointer, digits: usize| mean(pointer).map_or("-".to_owned(), |x| format!("{x:.digits$}"));
            let count = |pointer| mean(pointer).map_or("-".to_owned(), |x| format_count(x.round() as u64));
            let ok = members.iter().filter(|r| r.status == Status::Ok).count();
            let noisy = if members.iter().any(|r| r.noisy && r.status == Status::Ok) { " *" } else { "" };
            vec![
                (*scene).to_owned(),
                (*budget).to_owned(),
                (*variant).to_owned(),
                if ok == members.len() { ok.to_string() } else { format!("{ok}/{}", members.len()) },
                text("/quality/psnr", 2),
                text("/quality/grad_psnr", 2),
                text("/quality/ssim_3dgs", 4),
                text("/quality/flip", 4),
                count("/size/splats"),
                count("/size/texels"),
                count("/size/params"),
                format!("{}{noisy}", text("/time/train_cpu_secs", 1)),
            ]
        })
        .collect();
    let header = [
        "scene", "budget", "variant", "runs", "PSNR", "grad", "SSIM", "FLIP", "splats", "texels", "params",
        "CPU s",
    ];
    let mut text = columns(&header, &rows);
    if records.iter().any(|r| r.noisy) {
        text += "* the machine was busy with other work: see \"noisy_because\" in the results\n";
    }
    text
}

/// What the runs make of the checks in the scenes of the matrix, if it has any.
///
/// # Errors
/// What reading the figures of the runs reports.
pub fn checks(records: &[&Record], matrix: &Matrix) -> Result<String> {
    let cases = Case::all(matrix);
    let is_checked = cases.iter().any(|case| !case.checks.is_empty());
    match is_checked && records.iter().any(|r| r.status == Status::Ok) {
        true => checks_markdown(records.iter().copied().cloned().collect(), cases),
        false => Ok(String::new()),
    }
}
