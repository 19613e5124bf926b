//! Implausible figures in damaged or invented results. They are dropped before anything is computed or drawn: a single
//! one would ruin every mean and every axis.

use super::scale::counted;
use crate::results::Record;
use litetex_gs::Report;
use serde_json::Value;

/// Largest plausible quality figure, in dB or as an index.
const QUALITY_MAX: f64 = 1e6;
/// Largest plausible count, in splats, bytes or seconds.
const AMOUNT_MAX: f64 = 1e15;

/// Parts of a summary that charts take figures from.
const PARTS: [&str; 6] = ["quality", "size", "time", "fps", "curve", "memory_peak_bytes"];

/// Replaces implausible figures with null, and warns with their number.
pub fn drop_implausible(runs: &mut [Record], report: &mut Report) {
    let mut found = Vec::new();
    let mut first = None;
    for run in runs {
        for part in PARTS {
            if let Some(value) = run.summary.as_mut().and_then(|s| s.get_mut(part)) {
                clean(value, part, if part == "quality" { QUALITY_MAX } else { AMOUNT_MAX }, &mut found);
            }
        }
        if first.is_none() && !found.is_empty() {
            first = Some(run.describe());
        }
    }
    if let (Some(run), Some((name, value))) = (first, found.first()) {
        report.warn(
            "implausible-values",
            found.len(),
            format!(
                "{} ignored (quality beyond {QUALITY_MAX:.0e}, or others beyond \
                 {AMOUNT_MAX:.0e}); the first is {name} = {value:e} of {run}",
                counted(found.len(), "implausible value")
            ),
        );
    }
}

fn clean(value: &mut Value, name: &str, max: f64, found: &mut Vec<(String, f64)>) {
    match value {
        Value::Number(number) => {
            let x = number.as_f64().unwrap_or(f64::NAN);
            if !x.is_finite() || x.abs() > max {
                found.push((name.to_owned(), x));
                *value = Value::Null;
            }
        }
        Value::Array(all) => all.iter_mut().for_each(|v| clean(v, name, max, found)),
        Value::Object(all) => {
            for (key, v) in all {
                clean(v, key, if key.contains("psnr") { QUALITY_MAX } else { max }, found);
            }
        }
        Value::Null | Value::Bool(_) | Value::String(_) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::record;
    use super::*;
    use serde_json::json;

    #[test]
    fn implausible_figures_are_counted_and_dropped_and_the_rest_is_untouched() {
        let good = record(0, ("s", "v", "b"), 1, 20.0);
        let mut bad = good.clone();
        let summary = bad.summary.as_mut().unwrap();
        summary["quality"]["psnr"] = json!(1e308);
        summary["curve"][1]["grad_psnr_test"] = json!(-1e7);
        summary["size"]["params"] = json!(u64::MAX);
        summary["seed"] = json!(u64::MAX);
        let mut report = Report::default();
        let mut runs = [good.clone(), bad];
        drop_implausible(&mut runs, &mut report);
        assert_eq!(runs[0], good);
        let summary = runs[1].summary.as_ref().unwrap();
        assert_eq!(
            summary["quality"],
            json!({ "psnr": null, "grad_psnr": 28.0, "ssim_3dgs": 0.5, "flip": 0.05 })
        );
        assert!(summary["curve"][1]["grad_psnr_test"].is_null() && summary["curve"][1]["step"] == 200);
        assert!(summary["size"]["params"].is_null() && summary["seed"] == u64::MAX);
        assert_eq!((report.warnings.len(), report.warnings[0].count), (1, 3));
        assert!(report.warnings[0].message.contains("psnr = 1e308 of scene \"s\""), "{report:?}");
        // Negative control: large models are plausible.
        let mut large = good;
        large.summary.as_mut().unwrap()["size"]["disk"]["ltgs_tiny"] = json!(40_000_000_000_u64);
        let mut report = Report::default();
        drop_implausible(&mut [large], &mut report);
        assert!(report.warnings.is_empty());
    }
}
