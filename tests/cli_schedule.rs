//! `litetex schedule` on a small sample capture.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use assert_cmd::Command;
use serde_json::Value;

/// Exit code, standard output, standard error.
fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("litetex").unwrap().args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
}

fn ok(arguments: &[&str]) -> String {
    let (code, stdout, stderr) = run(arguments);
    assert_eq!(code, 0, "{arguments:?}\n{stdout}{stderr}");
    stdout
}

/// A folder with a capture of 5 images, one of them held out.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let size = ["--size", "320x240", "--points", "50", "--no-truth", "-q"];
        ok(&[&["sample", &place.path("capture"), "--views", "5"], &size[..]].concat());
        place
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    fn schedule(&self, arguments: &[&str]) -> String {
        ok(&[&["schedule", &self.path("capture"), "-q"], arguments].concat())
    }

    /// As JSON, without what depends on the clock.
    fn json(&self, arguments: &[&str]) -> Value {
        let text = self.schedule(&[&["--json"], arguments].concat());
        let mut value: Value = serde_json::from_str(&text).unwrap();
        for timing in ["analysis_secs", "analysis_cpu_secs"] {
            assert!(value.as_object_mut().unwrap().remove(timing).unwrap().is_f64());
        }
        value
    }
}

#[test]
fn stages_cover_the_training_and_tables_match_the_json() {
    let place = Place::new();
    let json = place.json(&["--steps", "1000"]);
    assert_eq!(
        (&json["schema"], &json["steps"], &json["schedule_steps"]),
        (&"litetex-schedule/1".into(), &1000.into(), &667.into())
    );
    assert_eq!(json["densify_until"], 500);
    assert_eq!((&json["schedule"]["views"], &json["width_px"]), (&4.into(), &320.into()));
    let stages = json["stages"].as_array().unwrap();
    let step = |stage: &Value, name: &str| stage[name].as_u64().unwrap();
    assert!(stages.len() > 3, "{json:#}");
    assert_eq!((step(&stages[0], "first_step"), step(&stages[stages.len() - 1], "last_step")), (1, 1000));
    for pair in stages.windows(2) {
        assert_eq!(step(&pair[0], "last_step") + 1, step(&pair[1], "first_step"));
        assert!(pair[0]["texture_cap"].as_u64() <= pair[1]["texture_cap"].as_u64());
        assert!(pair[0]["render_scale"].as_f64() >= pair[1]["render_scale"].as_f64());
    }
    let shares: f64 = stages.iter().map(|s| s["pixel_share"].as_f64().unwrap()).sum();
    assert!((shares - 1.0).abs() < 1e-12);
    let last = &stages[stages.len() - 1];
    assert_eq!((&last["height_px"], &last["texture_cap"]), (&240.into(), &256.into()));
    assert_eq!(step(last, "first_step"), 668);

    let longest = place.json(&["--steps", "4294967295"]);
    assert_eq!(longest["stages"].as_array().unwrap().last().unwrap()["last_step"], u32::MAX);

    let table = place.schedule(&["--steps", "1000"]);
    assert_eq!(table.lines().skip_while(|l| !l.is_empty()).skip(2).count(), stages.len(), "{table}");
    assert!(table.contains("668 - 1,000") && table.contains("320x240"), "{table}");
}

#[test]
fn rules_change_the_schedule_and_threads_do_not() {
    let place = Place::new();
    let work = |arguments: &[&str]| place.json(arguments)["pixel_work"].as_f64().unwrap();
    let paper = work(&["--rules", "paper", "--until", "20000"]);
    assert!(paper < 0.95 && work(&[]) < paper - 0.02, "sizes in finer steps save pixels; {paper}");
    assert!(work(&["--until", "15000"]) > work(&[]) + 0.02, "full images for longer");
    assert_eq!(work(&["--max-scale", "1"]), 1.0);
    let json = |rules: &str| place.json(&["--rules", rules]);
    assert_eq!(json("default")["schedule"], place.json(&[])["schedule"]);
    assert_eq!(json("authors")["schedule_steps"], 15_000, "the published schedule ends with densification");
    assert_ne!(json("authors")["schedule"], json("paper")["schedule"]);
    assert_eq!(place.json(&["--threads", "1"]), place.json(&["--threads", "3"]));
}

#[test]
fn bad_arguments_and_bad_captures_have_different_exit_codes() {
    let place = Place::new();
    let capture = place.path("capture");
    for (arguments, code, part) in [
        (&[&capture, "--beta", "0.5"][..], 2, "beta"),
        (&[&capture, "--max-scale", "0"], 2, "max-scale"),
        (&[&capture, "--rules", "half"], 2, "authors"),
        (&[&place.path("nowhere")], 3, "nowhere"),
    ] {
        let (got, stdout, stderr) = run(&[&["schedule"], arguments].concat());
        assert_eq!(got, code, "{arguments:?}: {stderr}");
        assert!(stdout.is_empty() && stderr.contains(part), "{arguments:?}: {stderr}");
    }
}
