//! Every stress of `litetex sample`, small: benched, evaluated and charted, without a figure that is not finite.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

mod common;

use common::run;
use litetex_gs::sample::Stress;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Stresses whose photos show something that figures are about.
const WITH_REGIONS: [&str; 5] = ["checker", "wires", "mirror", "sky", "walker"];

/// A matrix of all stresses, small, and of captures with few points and views.
fn matrix() -> String {
    let mut text = r#"
        sample = ["--views", "12", "--size", "64x48", "--rays", "1", "--points", "120", "--no-truth"]
        common = ["--device", "cpu", "--steps", "24", "--test-list", "{capture}/test.txt"]
        eval = ["--worst", "{run}/worst.jpg"]
        seeds = [1]
    "#
    .to_owned();
    let mut scene = |name: &str, sample: &str, measured: &str| {
        text += &format!("[[scene]]\nname = \"{name}\"\nsample = [{sample}]\n{measured}\n");
        text += "check = [{ name = \"PSNR\", measure = \"/quality/psnr\", at-least = 0, may-fail = true }]\n";
    };
    for stress in Stress::all() {
        let name = stress.to_string();
        let kind = name.split(':').next().unwrap();
        let figures = match kind {
            "cards" => "figures = [\"--sequence\"]",
            _ if WITH_REGIONS.contains(&kind) => "figures = [\"--regions\", \"{capture}/regions\"]",
            _ => "",
        };
        let level = if kind == "cards" { ":8" } else { "" };
        scene(kind, &format!("\"--stress\", \"{kind}{level}\""), figures);
    }
    for level in ["1", "2"] {
        scene(
            &format!("views {level}"),
            &format!("\"--stress\", \"views:{level}\""),
            "eval = [\"--training\"]",
        );
    }
    scene("10 points", "\"--stress\", \"none\", \"--points\", \"10\"", "");
    scene("no points", "\"--stress\", \"none\", \"--points\", \"0\"", "");
    text
}

#[test]
fn every_stress_trains_is_evaluated_and_charted() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (file, out, chart) = (path("stress.toml"), path("bench"), path("chart"));
    fs::write(&file, matrix()).unwrap();
    let (code, stdout, stderr) = run(&["bench", "--config", &file, "-o", &out, "-q"]);
    let lines = fs::read_to_string(Path::new(&out).join("results.jsonl")).unwrap();
    let records: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(records.len(), Stress::all().count() + 4);
    let of = |name: &str| records.iter().find(|r| r["scene"] == name).unwrap();
    for record in &records {
        let scene = &record["scene"];
        if record["status"] == "ok" {
            let psnr = record["summary"]["quality"]["psnr"].as_f64();
            assert!(psnr.is_some_and(|p| p > 3.0), "{scene}: {psnr:?}");
        } else {
            // A clear error about what the capture lacks, and nothing else.
            assert!(record["exit_code"] == 3 && scene == "no points", "{scene}: {}", record["error"]);
        }
    }
    assert_eq!(code, if of("no points")["status"] == "ok" { 0 } else { 1 }, "{stdout}{stderr}");
    let row = |line: &str| line.starts_with("sky ") && line.contains("PSNR");
    assert!(stdout.contains("every check passes") && stdout.lines().any(row), "{stdout}");
    for kind in WITH_REGIONS {
        let regions = &of(kind)["summary"]["figures"]["regions"];
        assert!(regions["pixel_share"].as_f64().is_some_and(|s| s > 0.0 && s < 1.0), "{kind}: {regions}");
        let recall = regions["recall"].as_f64();
        assert_eq!(recall.is_some(), kind != "walker", "{kind}: test photos are without the figure");
        assert!(recall.is_none_or(|r| (0.0..=1.0).contains(&r)), "{kind}: {regions}");
    }
    let flicker = of("cards")["summary"]["figures"]["sequence"]["mean_error_of_changes"].as_f64().unwrap();
    assert!(flicker > 1e-4 && flicker < 0.5, "{flicker}");
    let training = of("views 1")["summary"]["eval"]["training"]["psnr"].as_f64().unwrap();
    assert!(training > 8.0, "{training}");
    // The written frame changes the result by rounding only: 24 steps are too few for noise to grow. Measured 0.02.
    let psnr = |name: &str| of(name)["summary"]["quality"]["psnr"].as_f64().unwrap();
    for frame in ["offset", "scale"] {
        assert!((psnr(frame) - psnr("none")).abs() < 0.3, "{frame}: {} and {}", psnr(frame), psnr("none"));
    }

    let (code, stdout, stderr) = run(&["chart", &out, "--checks", &file, "-o", &chart]);
    assert_eq!(code, 0, "{stdout}{stderr}");
    let page = fs::read_to_string(Path::new(&chart).join("index.html")).unwrap();
    assert!(page.matches("data:image/jpeg;base64,").count() >= Stress::all().count());
    let checks = fs::read_to_string(Path::new(&chart).join("tables/checks.csv")).unwrap();
    assert_eq!(checks.lines().count(), 1 + Stress::all().count() + 4);
    assert!(checks.lines().skip(1).all(|line| line.ends_with(",pass")), "{checks}");
    assert!(Path::new(&chart).join("charts/checks.svg").exists());
    // The same command makes nothing again; what is wrong with a matrix is said before anything is made.
    assert_eq!(run(&["bench", "--config", &file, "-o", &out, "-q"]).0, code);
    fs::write(&file, matrix().replace("mirror", "fog")).unwrap();
    let (code, _, stderr) = run(&["bench", "--config", &file, "-o", &path("other"), "-q"]);
    assert!(code == 2 && stderr.contains("fog") && stderr.contains("no such stress"), "{stderr}");
    assert!(!Path::new(&path("other")).exists());
}
