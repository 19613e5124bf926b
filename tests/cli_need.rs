//! The need suite, small: its captures are made, its runs benched and charted, and every check has a figure.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("litetex").unwrap().args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
}

/// The suite with fewer pixels, rays and steps.
fn small_suite() -> String {
    let suite = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/need.toml");
    let mut text = fs::read_to_string(suite).unwrap();
    for (large, small) in [
        ("\"128x96\"", "\"64x48\""),
        ("\"--rays\", \"4\"", "\"--rays\", \"2\""),
        ("\"--steps\", \"1000\"", "\"--steps\", \"30\", \"--device\", \"cpu\""),
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
    // Negative control: 30 steps are too few for a scene that shows something, unless its points show it all.
    let is_easy = |line: &str| line.contains("flat") || line.contains("5,000 points");
    let psnr: Vec<&str> = checks.lines().filter(|line| line.contains("PSNR") && !is_easy(line)).collect();
    assert_eq!(psnr.len(), 9);
    assert!(psnr.iter().all(|line| line.matches(",fail").count() == 4), "{psnr:?}");
}

/// A wall in a folder, and a training of it with these arguments, given as words; returns the summary.
fn wall(dir: &Path) -> impl Fn(&str) -> Value {
    let path = |name: &str| dir.join(name).to_str().unwrap().to_owned();
    let (capture, split, out) = (path("wall"), path("wall/test.txt"), path("run"));
    let sample = "--scene wall:4 --views 12 --size 64x48 --rays 2 --points 150 --no-truth -q";
    let arguments: Vec<&str> = ["sample", &capture].into_iter().chain(sample.split(' ')).collect();
    assert_eq!(run(&arguments).0, 0);
    move |words: &str| {
        let train = "--steps 300 --seed 1 --device cpu --background #808080 --backdrop none --init sfm --max-points 60 \
                     --force -q";
        let arguments: Vec<&str> = ["train", &capture, "-o", &out, "--test-list", &split]
            .into_iter()
            .chain(train.split_ascii_whitespace())
            .chain(words.split_ascii_whitespace())
            .collect();
        let (code, _, stderr) = run(&arguments);
        assert_eq!(code, 0, "{stderr}");
        let summary = fs::read_to_string(Path::new(&out).join("summary.json")).unwrap();
        serde_json::from_str(&summary).unwrap()
    }
}

#[test]
fn models_merge_on_the_way_to_their_budget_and_no_further() {
    let dir = tempfile::tempdir().unwrap();
    let train = wall(dir.path());
    // Splats merged in each round, parameters after it, and those of the model.
    let merged = |merge: &str| {
        let summary = train(&format!("--budget-params 900 --set {merge}"));
        assert!(summary["size"]["params"].as_u64().unwrap() <= 900, "{summary}");
        let rounds = summary["given_back"].as_array().unwrap();
        let of = |round: &Value| ["merged", "params"].map(|key| round[key].as_u64().unwrap());
        rounds.iter().map(of).collect::<Vec<_>>()
    };
    let [first, last] = merged("density.merge=true")[..] else { panic!("expected two rounds") };
    assert!(first[0] > 5 && first[1] >= 900, "{first:?}");
    assert!(last[0] == 0 && last[1] <= 900, "{last:?}");
    // Negative control: rounds that may not merge.
    let without = merged("density.merge=false");
    assert!(without.iter().all(|[merged, _]| *merged == 0) && without[0][1] > first[1], "{without:?}");
}

#[test]
fn a_model_within_its_budget_gives_back_by_need_only() {
    let dir = tempfile::tempdir().unwrap();
    let train = wall(dir.path());
    let given_back = |words: &str| train(words)["given_back"].as_array().unwrap().clone();
    let within = given_back("--need 0.05 --budget-params 1M");
    assert!(
        within.iter().all(|round| round["params"].as_u64() < round["params_before"].as_u64()),
        "{within:?}"
    );
    assert!(!within.is_empty());
    assert_eq!(within, given_back("--need 0.05"), "a budget that does not bind changes nothing");
    assert!(given_back("--budget-params 1M").is_empty());
}
