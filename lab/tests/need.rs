//! The need suite, small: its captures are made, its runs benched and charted, and every check has a figure.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

mod common;

use common::run;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The suite with fewer pixels, rays and steps.
fn small_suite() -> String {
    let suite = Path::new(env!("CARGO_MANIFEST_DIR")).join("../samples/need.toml");
    let mut text = fs::read_to_string(suite).unwrap();
    for (large, small) in [
        ("\"128x96\"", "\"64x48\""),
        ("\"--rays\", \"4\"", "\"--rays\", \"2\""),
        ("\"--steps\", \"1000\"", "\"--steps\", \"15\", \"--device\", \"cpu\""),
    ] {
        assert_eq!(text.matches(large).count(), 1, "{large}");
        text = text.replace(large, small);
    }
    text
}

#[test]
fn the_suite_trains_is_evaluated_and_charted() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (file, out, chart) = (path("need.toml"), path("bench"), path("chart"));
    fs::write(&file, small_suite()).unwrap();
    let (code, stdout, stderr) = run(&["bench", "--config", &file, "-o", &out, "-q"]);
    assert_eq!(code, 0, "{stdout}{stderr}");
    let lines = fs::read_to_string(Path::new(&out).join("results.jsonl")).unwrap();
    let records: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(records.len(), 15 * 4);
    for record in &records {
        let (scene, summary) = (&record["scene"], &record["summary"]);
        assert!(summary["quality"]["psnr"].as_f64().is_some_and(|p| p > 10.0), "{scene}: {record}");
        assert_eq!(summary["capture"]["test_views"], 3, "{scene}");
        // Nothing but the points of the capture becomes splats.
        let splats = summary["size"]["splats"].as_u64().unwrap();
        assert!(
            splats <= summary["capture"]["points"].as_u64().unwrap().max(1000) + 1000,
            "{scene}: {splats}"
        );
    }

    let (code, stdout, stderr) = run(&["chart", &out, "--checks", &file, "-o", &chart]);
    assert_eq!(code, 0, "{stdout}{stderr}");
    assert!(stdout.contains("SH coefficients") && stdout.contains("texels to isotropic growth"), "{stdout}");
    let checks = fs::read_to_string(Path::new(&chart).join("tables/checks.csv")).unwrap();
    // 12 scenes with a PSNR, 11 limits over a bound, 4 of the flat scenes, and 7 others; and figures without limits.
    let shown = checks.lines().filter(|line| line.matches(",shown").count() == 4).count();
    assert_eq!(checks.lines().count() - shown, 1 + 12 + 11 + 4 + 7, "{checks}");
    assert_eq!(shown, 57);
    assert!(checks.contains("CPU seconds to 40 dB"), "{checks}");
    let unknown: Vec<&str> = checks.lines().filter(|line| line.contains("unknown")).collect();
    // Without a texel none is in the easy quadrants.
    assert!(unknown.iter().all(|line| line.starts_with("quilt,texels in the easy quadrants")), "{unknown:?}");
    // Negative control: 15 steps are too few for a scene that shows something, unless its points show it all.
    let is_easy = |line: &str| ["flat", "5,000 points", "wall 4,"].iter().any(|easy| line.contains(easy));
    let psnr: Vec<&str> = checks.lines().filter(|line| line.contains("PSNR") && !is_easy(line)).collect();
    assert_eq!(psnr.len(), 8);
    assert!(psnr.iter().all(|line| line.matches(",fail").count() == 4), "{psnr:?}");
}
