//! Puts together what `scripts/device-kit` has left in a folder: `device-kit.json` and a short table. Of each
//! part there is a line `name exit-code seconds` in `parts.txt`, its output in `NAME.out` and `NAME.err`, its
//! figures in `NAME.json` (measured kernels) or `NAME/summary.json` (training).

use super::table::Table;
use litetex_gs::{Error, Result, atomic_file};
use serde_json::{Map, Value, json};
use std::fs;
use std::path::Path;

/// Schema of the JSON.
const SCHEMA: &str = "litetex-device-kit/1";
/// Exit code of `timeout`.
const TIMED_OUT: i64 = 124;

/// Points of a curve in the table.
const CURVE_POINTS: usize = 6;

/// A part of the kit.
struct Part {
    name: String,
    code: i64,
    secs: f64,
    out: String,
    /// Why it failed; empty if it did not.
    message: String,
    figures: Value,
}

/// Collects, writes and prints.
///
/// # Errors
/// [`Error::CheckFailed`] if a part failed; [`Error::Io`], [`Error::InvalidInput`] if the folder is not the kit's.
pub fn collect(folder: &Path) -> anyhow::Result<()> {
    let list = folder.join("parts.txt");
    let text = fs::read_to_string(&list).map_err(|e| Error::io(&list, e))?;
    let parts = text.lines().map(|line| part(folder, &list, line)).collect::<Result<Vec<_>>>()?;
    let failed: Vec<&str> = parts.iter().filter(|p| p.code != 0).map(|p| p.name.as_str()).collect();
    let kit = put_together(&parts);
    atomic_file::write(&folder.join("device-kit.json"), &serde_json::to_vec_pretty(&kit)?)?;
    table(&parts, &kit).print()?;
    if failed.is_empty() {
        return Ok(());
    }
    Err(Error::CheckFailed(format!(
        "{} of {} parts failed: {}",
        failed.len(),
        parts.len(),
        failed.join(", ")
    ))
    .into())
}

fn part(folder: &Path, list: &Path, line: &str) -> Result<Part> {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let wrong = || Error::invalid(list, format!("{line:?}: expected a name, an exit code and seconds"));
    let [name, code, secs] = fields[..] else { return Err(wrong()) };
    let (code, secs): (i64, f64) = (code.parse().map_err(|_| wrong())?, secs.parse().map_err(|_| wrong())?);
    // What a part that failed early has not written is empty.
    let read = |name: String| fs::read_to_string(folder.join(name)).unwrap_or_default();
    let parsed = |text: String| serde_json::from_str(&text).unwrap_or(Value::Null);
    let figures = match parsed(read(format!("{name}.json"))) {
        Value::Null => parsed(read(format!("{name}/summary.json"))),
        figures => figures,
    };
    let errors = read(format!("{name}.err"));
    let message = match (code, errors.lines().rfind(|l| !l.trim().is_empty())) {
        (0, _) => String::new(),
        (TIMED_OUT, _) => format!("stopped after {secs:.0} s: its time was over"),
        (_, Some(last)) => last.to_owned(),
        (_, None) => format!("exit code {code}"),
    };
    Ok(Part { name: name.to_owned(), code, secs, out: read(format!("{name}.out")), message, figures })
}

fn put_together(parts: &[Part]) -> Value {
    let list: Vec<Value> = parts
        .iter()
        .map(|p| json!({ "name": p.name, "passed": p.code == 0, "exit_code": p.code, "wall_secs": p.secs, "message": p.message }))
        .collect();
    // "bench-480" is "480" in "bench".
    let group = |prefix: &str| {
        let members =
            parts.iter().filter_map(|p| Some((p.name.strip_prefix(prefix)?.to_owned(), p.figures.clone())));
        members.collect::<Map<String, Value>>()
    };
    let bench = group("bench-");
    let of_first =
        |key: &str| bench.values().map(|b| b[key].clone()).find(|v| !v.is_null()).unwrap_or(Value::Null);
    let repeatable: Vec<&Value> = bench.values().map(|b| &b["repeatable"]).filter(|v| !v.is_null()).collect();
    let selftest = parts.iter().find(|p| p.name == "selftest");
    json!({
        "schema": SCHEMA,
        "version": env!("CARGO_PKG_VERSION"),
        "passed": parts.iter().all(|p| p.code == 0),
        "parts": list,
        "device": of_first("device"),
        "devices": parts.iter().find(|p| p.name == "devices")
            .and_then(|p| serde_json::from_str::<Value>(&p.out).ok()),
        "selftest": selftest.map(|p| json!({ "passed": p.code == 0, "lines": p.out.lines().collect::<Vec<_>>() })),
        "sort": bench.values().map(|b| b["sort"].clone()).find(|s| s.as_array().is_some_and(|s| !s.is_empty())),
        "variants": bench.iter().map(|(k, b)| (k.clone(), b["variants"].clone())).collect::<Map<_, _>>(),
        "repeatable": (!repeatable.is_empty()).then(|| repeatable.iter().all(|v| **v == true)),
        "train": group("train-"),
        "bench": bench,
    })
}

fn table(parts: &[Part], kit: &Value) -> Table {
    let mut table = Table::default();
    let text = |v: &Value| v.as_str().unwrap_or("-").to_owned();
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    table
        .row("device", format!("{} ({})", text(&kit["device"]["name"]), text(&kit["device"]["description"])));
    for part in parts {
        let verdict = if part.code == 0 { "passed" } else { "FAILED" };
        let colon = if part.message.is_empty() { "" } else { ": " };
        table.row(&part.name, format!("{verdict}, {:.0} s{colon}{}", part.secs, part.message));
        let f = &part.figures;
        if f["steps_per_sec"].is_number() {
            let (rate, secs) = (number(&f["steps_per_sec"]), number(&f["wall_secs_per_step"]));
            let largest = f["kernel_secs"].as_array().map_or(&[][..], |k| &k[..k.len().min(4)]);
            let largest: Vec<String> =
                largest.iter().map(|k| format!("{} {:.3} ms", text(&k[0]), 1e3 * number(&k[1]))).collect();
            table.row(
                "  kernels",
                format!("{rate:.2} it/s, {:.3} ms a step; {}", 1e3 * secs, largest.join(", ")),
            );
        }
        if let Some(curve) = f["curve"].as_array() {
            let secs = number(&f["time"]["train_wall_secs"]);
            let rate = number(&f["steps"]) / secs.max(1e-9);
            let point = |p: &Value| {
                format!("{:.2} dB after {:.0} s", number(&p["psnr_test"]), number(&p["wall_secs"]))
            };
            // A few, evenly spread, the last among them.
            let every = curve.len().div_ceil(CURVE_POINTS).max(1);
            let mut points: Vec<String> = curve.iter().rev().step_by(every).map(point).collect();
            points.reverse();
            table.row(
                "  training",
                format!("{rate:.2} it/s, {:.3} ms a step; {}", 1e3 / rate, points.join(", ")),
            );
        }
    }
    for sort in kit["sort"].as_array().into_iter().flatten() {
        table.row(
            &format!("sort of {}", sort["keys"]),
            format!("{:.3e} keys/s", number(&sort["keys_per_sec"])),
        );
    }
    let verdict = match kit["repeatable"].as_bool() {
        Some(true) => "yes",
        Some(false) => "NO",
        None => "unknown",
    };
    table.row("repeatable", verdict);
    table
}
