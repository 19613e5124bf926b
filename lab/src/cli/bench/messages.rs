//! Messages of a benchmark: a line per finished run, the list of runs.

use litetex_gs::Report;
use litetex_gs::console::{Log, Output, columns};
use litetex_gs::text::{format_count, format_duration};
use litetex_lab::matrix::Cell;
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
