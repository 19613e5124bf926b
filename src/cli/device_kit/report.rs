//! What came of the parts: `device-kit.json` and a short table.

use super::super::table::Table;
use super::super::values::format_count;
use super::part::{Outcome, Part};
use litetex_gs::{Error, atomic_file};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Schema of the JSON.
const SCHEMA: &str = "litetex-device-kit/2";

/// Points of a curve in the table.
const CURVE_POINTS: usize = 6;

/// Writes and prints.
///
/// # Errors
/// [`Error::CheckFailed`] if a part failed; [`Error::Io`] if the folder cannot be written.
pub fn publish(folder: &Path, device: &str, parts: &[Part]) -> anyhow::Result<()> {
    let kit = put_together(device, parts);
    atomic_file::write(&folder.join("device-kit.json"), &serde_json::to_vec_pretty(&kit)?)?;
    table(parts, &kit).print()?;
    let failed: Vec<&str> = parts.iter().filter(|p| has_failed(p)).map(|p| p.name.as_str()).collect();
    if failed.is_empty() {
        return Ok(());
    }
    let what = format!("{} of {} parts failed: {}", failed.len(), parts.len(), failed.join(", "));
    Err(Error::CheckFailed(what).into())
}

fn has_failed(part: &Part) -> bool {
    matches!(part.outcome, Outcome::Failed(..))
}

/// The device by the name that was asked for, as the list of devices knows it.
fn listed(devices: &Value, asked: &str) -> Value {
    let all: Vec<&Value> =
        devices.as_array().into_iter().flatten().filter(|d| d["usable"] != false).collect();
    let name = |d: &Value| d["name"].as_str().unwrap_or_default().to_owned();
    let found = match asked.to_lowercase().as_str() {
        "gpu" => all.iter().find(|d| d["hardware"] == true),
        "auto" => all.iter().find(|d| d["auto"] == true),
        asked => {
            let mut partial = all.iter().filter(|d| name(d).contains(asked));
            let exact = all.iter().find(|d| name(d) == asked);
            exact.or_else(|| partial.next().filter(|_| partial.next().is_none()))
        }
    };
    match found {
        Some(device) => json!({ "name": device["name"], "description": device["description"] }),
        None => json!({ "name": asked, "description": "not among the devices here" }),
    }
}

fn put_together(asked: &str, parts: &[Part]) -> Value {
    let entry = |p: &Part| {
        let (passed, code) = match p.outcome {
            Outcome::Passed => (Some(true), Some(0)),
            Outcome::Skipped(_) => (None, None),
            Outcome::Failed(code, _) => (Some(false), code),
        };
        let skipped = passed.is_none();
        json!({ "name": p.name, "passed": passed, "skipped": skipped, "exit_code": code, "wall_secs": p.secs,
            "message": p.message() })
    };
    let list: Vec<Value> = parts.iter().map(entry).collect();
    // "bench-480" is "480" in "bench".
    let group = |prefix: &str| {
        let members =
            parts.iter().filter_map(|p| Some((p.name.strip_prefix(prefix)?.to_owned(), p.figures.clone())));
        members.collect::<Map<String, Value>>()
    };
    let bench = group("bench-");
    let of_first =
        |key: &str| bench.values().map(|b| b[key].clone()).find(|v| !v.is_null()).unwrap_or(Value::Null);
    let repeatable = repeatable(&bench);
    let selftest = parts.iter().find(|p| p.name == "selftest");
    let devices = parts.iter().find(|p| p.name == "devices");
    let devices = devices.and_then(|p| serde_json::from_str::<Value>(&p.out).ok()).unwrap_or_default();
    let device = match of_first("device") {
        Value::Null => listed(&devices, asked),
        measured => measured,
    };
    json!({
        "schema": SCHEMA,
        "version": env!("CARGO_PKG_VERSION"),
        "passed": !parts.iter().any(has_failed),
        "parts": list,
        "device": device,
        "devices": devices,
        "selftest": selftest.map(|p| json!({ "passed": p.outcome == Outcome::Passed, "lines": p.out.lines().collect::<Vec<_>>() })),
        "sort": bench.values().map(|b| b["sort"].clone()).find(|s| s.as_array().is_some_and(|s| !s.is_empty())),
        "variants": bench.iter().map(|(k, b)| (k.clone(), b["variants"].clone())).collect::<Map<_, _>>(),
        "repeatable": repeatable,
        "train": group("train-"),
        "bench": bench,
    })
}

/// Whether equal steps gave equal bytes: at which sizes they did, at which they did not, and at which it was not
/// tried. `all` only if it was tried, and true, at every size.
fn repeatable(bench: &Map<String, Value>) -> Value {
    let of = |wanted: Value| -> Vec<&String> {
        bench.iter().filter(|(_, b)| b["repeatable"] == wanted).map(|(size, _)| size).collect()
    };
    let [yes, no, not_tried] = [json!(true), json!(false), Value::Null].map(of);
    let all = match (yes.as_slice(), no.as_slice(), not_tried.as_slice()) {
        (_, [_, ..], _) => Some(false),
        ([_, ..], [], []) => Some(true),
        _ => None,
    };
    json!({ "all": all, "yes": yes, "no": no, "not_tried": not_tried })
}

/// The same in words.
fn repeatable_words(repeatable: &Value) -> String {
    let sizes = |key: &str| -> Vec<&str> {
        repeatable[key].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
    };
    let parts = [("NO", "no"), ("yes", "yes"), ("not tried", "not_tried")]
        .map(|(word, key)| (word, sizes(key)))
        .into_iter()
        .filter(|(_, sizes)| !sizes.is_empty())
        .map(|(word, sizes)| format!("{word}: {}", sizes.join(", ")));
    let words = parts.collect::<Vec<_>>().join("; ");
    if words.is_empty() { "not tried".to_owned() } else { words }
}

fn table(parts: &[Part], kit: &Value) -> Table {
    let mut table = Table::default();
    let text = |v: &Value| v.as_str().unwrap_or("-").to_owned();
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    table
        .row("device", format!("{} ({})", text(&kit["device"]["name"]), text(&kit["device"]["description"])));
    for part in parts {
        let verdict = match part.outcome {
            Outcome::Passed => "passed",
            Outcome::Skipped(_) => "skipped",
            Outcome::Failed(..) => "FAILED",
        };
        let colon = if part.message().is_empty() { "" } else { ": " };
        table.row(&part.name, format!("{verdict}, {:.0} s{colon}{}", part.secs, part.message()));
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
            let ms = |v: &Value| v.as_f64().map_or("-".to_owned(), |s| format!("{:.3} ms", 1e3 * s));
            for v in f["variants"].as_array().into_iter().flatten() {
                let name = if v["hardware_kernels"] == true { "  for hardware" } else { "  for software" };
                let (fwd, bwd) = (ms(&v["raster_fwd_secs"]), ms(&v["raster_bwd_secs"]));
                table.row(name, format!("forward {fwd}, backward {bwd}"));
            }
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
            table.row("  model", of_the_model(f));
        }
    }
    for sort in kit["sort"].as_array().into_iter().flatten() {
        table.row(
            &format!("sort of {}", sort["keys"]),
            format!("{:.3e} keys/s", number(&sort["keys_per_sec"])),
        );
    }
    table.row("repeatable", repeatable_words(&kit["repeatable"]));
    table
}

/// Size, quality and length of a training, and what share of it the density-control steps took.
fn of_the_model(summary: &Value) -> String {
    let count = |v: &Value| v.as_u64().map_or("-".to_owned(), format_count);
    let share = 100.0 * summary["time"]["density_control_wall_secs"].as_f64().unwrap_or(f64::NAN)
        / summary["time"]["train_wall_secs"].as_f64().unwrap_or(f64::NAN);
    let ended = match summary["stopped_by"].as_str() {
        Some("time") if summary["steps"] != summary["steps_planned"] => {
            format!(" of {}: its time was over", count(&summary["steps_planned"]))
        }
        _ => String::new(),
    };
    format!(
        "{} splats, {} texels, {:.2} dB after {} steps{ended}; density-control steps {share:.1} % of the time",
        count(&summary["size"]["primitives"]),
        count(&summary["size"]["texels"]),
        summary["quality"]["psnr"].as_f64().unwrap_or(f64::NAN),
        count(&summary["steps"]),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_training_is_told_with_its_size_quality_and_density_control_steps() {
        let summary = |stopped_by: &str| {
            json!({ "steps": 3000, "steps_planned": 4000, "stopped_by": stopped_by, "quality": { "psnr": 27.125 },
                "size": { "primitives": 14553, "texels": 1_000_000 },
                "time": { "train_wall_secs": 40.0, "density_control_wall_secs": 1.0 } })
        };
        let told = of_the_model(&summary("steps"));
        assert_eq!(
            told,
            "14,553 splats, 1,000,000 texels, 27.12 dB after 3,000 steps; density-control steps 2.5 % of the time"
        );
        assert!(of_the_model(&summary("time")).contains("3,000 steps of 4,000: its time was over"));
    }

    fn part(name: &str, outcome: Outcome, out: &str, figures: Value) -> Part {
        Part { name: name.to_owned(), outcome, secs: 1.0, out: out.to_owned(), figures }
    }

    #[test]
    fn sizes_at_which_repeating_was_not_tried_are_told() {
        let of = |sizes: &[(&str, Value)]| {
            let bench = sizes.iter().map(|(size, v)| ((*size).to_owned(), json!({ "repeatable": v })));
            let value = repeatable(&bench.collect());
            (value["all"].clone(), repeatable_words(&value))
        };
        let (yes, no) = (json!(true), json!(false));
        assert_eq!(
            of(&[("480", yes.clone()), ("960", yes.clone())]),
            (yes.clone(), "yes: 480, 960".to_owned())
        );
        let partly = of(&[("480", yes.clone()), ("960", Value::Null)]);
        assert_eq!(partly, (Value::Null, "yes: 480; not tried: 960".to_owned()));
        assert_eq!(of(&[("480", yes), ("960", no.clone())]), (no, "NO: 960; yes: 480".to_owned()));
        assert_eq!(of(&[]), (Value::Null, "not tried".to_owned()));
    }

    #[test]
    fn skipped_parts_are_no_failures_and_the_device_is_named_whatever_failed() {
        let list = r#"[{ "name": "arc-770", "description": "Arc", "hardware": true, "auto": true },
            { "name": "cpu", "description": "x86", "hardware": false, "auto": false },
            { "name": "lavapipe", "description": "Mesa", "hardware": false, "auto": false }]"#;
        let with_unfit =
            list.replacen("[{", r#"[{ "name": "old", "hardware": true, "usable": false }, {"#, 1);
        assert_eq!(listed(&serde_json::from_str(&with_unfit).unwrap(), "gpu")["name"], "arc-770");
        let failed = || Outcome::Failed(Some(5), "lost".to_owned());
        let parts = [
            part("devices", Outcome::Passed, list, Value::Null),
            part("bench-480", failed(), "", Value::Null),
            Part::skipped("train-full", "one step takes 30 s".to_owned()),
        ];
        let kit = put_together("lava", &parts);
        assert_eq!(kit["device"], json!({ "name": "lavapipe", "description": "Mesa" }));
        assert_eq!(put_together("gpu", &parts)["device"]["name"], "arc-770");
        assert_eq!(put_together("Auto", &parts)["device"]["name"], "arc-770");
        assert_eq!(put_together("a", &parts)["device"]["name"], "a", "two devices have an a");
        let skipped = &kit["parts"][2];
        assert!(skipped["passed"].is_null() && skipped["skipped"] == true && skipped["exit_code"].is_null());
        assert_eq!((&kit["passed"], &kit["parts"][1]["passed"]), (&json!(false), &json!(false)));
        // What was measured knows best.
        let measured = json!({ "device": { "name": "of-the-bench" }, "repeatable": true });
        let parts = [part("bench-480", Outcome::Passed, "", measured), Part::skipped("b", String::new())];
        let kit = put_together("lava", &parts);
        assert_eq!((&kit["device"]["name"], &kit["passed"]), (&json!("of-the-bench"), &json!(true)));
        assert_eq!(kit["repeatable"]["all"], true);
    }
}
