//! `litetex report` and the verdict of `litetex inspect`, on a tiny capture.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::cli::{bad, good, json, litetex, text};
use litetex_exporters::html;
use std::path::{Path, PathBuf};

/// A folder with a capture of 12 views and a run of a few steps, with and without test views and textures.
fn trained(folder: &Path, run: &str, more: &[&str]) -> PathBuf {
    let capture = folder.join("<i>cap\"ture");
    if !capture.exists() {
        let args = ["sample", text(&capture), "--views", "12", "--size", "48x36", "--points", "120"];
        good(&[&args[..], &["--no-truth", "-q"]].concat());
    }
    let run = folder.join(run);
    let args = ["train", text(&capture), "-o", text(&run), "--steps", "12", "--device", "cpu", "-q"];
    good(&[&args[..], &["--max-resolution", "48"], more].concat());
    run
}

fn report(run: &Path, page: &Path, more: &[&str]) -> serde_json::Value {
    let args = ["report", text(run), "-o", text(page), "--quality", "lossless", "--device", "cpu", "-q"];
    json(&[&args[..], more].concat())
}

#[test]
fn a_report_is_one_page_that_is_read_as_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let run = trained(folder.path(), "run", &["--set", "eval-every=6"]);
    let (page, compact) = (at("deep/page.html"), at("scene.ltgs"));
    good(&["export", text(&run), text(&compact), "--quality", "lossless", "--device", "cpu", "-q"]);
    let found = report(&run, &page, &["--licence", "<b>mine</b>"]);
    let bytes = std::fs::read(&page).unwrap();
    assert_eq!((&found["schema"], &found["bytes"]), (&"litetex-report/1".into(), &bytes.len().into()));
    assert_eq!(
        (&found["worst_views"]["are_training"], &found["no_photos"]),
        (&false.into(), &serde_json::Value::Null)
    );
    assert_eq!(found["worst_views"]["views"].as_array().unwrap().len(), 2, "of two test views");
    assert_eq!(found["verdict"]["rating"], "usable", "{}", found["verdict"]);
    let shares = found["coverage"]["splats_by_views"].as_array().unwrap().iter();
    assert!((shares.map(|share| share[1].as_f64().unwrap()).sum::<f64>() - 1.0).abs() < 1e-9);
    let html = String::from_utf8(bytes.clone()).unwrap();
    for expected in [
        "Worst views</h2>",
        "Coverage</h2>",
        "Training</h2>",
        "Test PSNR: ",
        "the scene in this page",
        "&lt;b&gt;mine",
        "&lt;i&gt;cap",
    ] {
        assert!(html.contains(expected), "{expected}");
    }
    assert!(!html.contains("<b>mine") && !html.contains("<i>cap"));
    // Read as any other page: the same scene, with another licence.
    assert!(html::embedded(&bytes, &page).is_ok());
    assert_eq!(json(&["validate", text(&page)])["valid"], true);
    assert_eq!(json(&["inspect", text(&page)])["hash"], json(&["inspect", text(&compact)])["hash"]);
    good(&["verify", text(&page), "--against", text(&run), "--device", "cpu", "-q"]);
    // Only the page is left.
    assert_eq!(std::fs::read_dir(at("deep")).unwrap().count(), 1);

    let (code, message) = bad(&["report", text(&run), "-o", text(&page), "--device", "cpu"]);
    assert!(code == 2 && message.contains("page.html") && message.contains("--force"), "{message}");
    let again = report(&run, &page, &["--force", text(&compact)]);
    assert_eq!(again["files"].as_array().unwrap().len(), 2, "{}", again["files"]);
    assert_eq!(again["files"][1]["name"], "scene.ltgs");
    assert_eq!(again["files"][1]["loss_db"], 0.0);
    // The run has ten training views, and its capture is read twice: for the page, and to verify the scene in it.
    let output = litetex(&["report", text(&run), "-o", text(&at("said.html")), "--device", "cpu", "-q"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.matches("[few-training-views]").count() == 1, "{said}");
    for (source, out, expected) in [
        (text(&run), "page.pdf", ".html"),
        (text(&compact), "b.html", "is an asset, expected a run"),
        (text(&at("none")), "b.html", "none"),
    ] {
        let (code, message) = bad(&["report", source, "-o", text(&at(out)), "--device", "cpu"]);
        assert!(code != 0 && message.contains(expected) && !at(out).exists(), "{message}");
    }
    // The capture is gone.
    std::fs::rename(at("<i>cap\"ture"), at("moved")).unwrap();
    let without = report(&run, &at("without.html"), &[]);
    assert!(without["worst_views"].is_null() && without["no_photos"].is_string(), "{without}");
    let moved = report(&run, &at("moved.html"), &["--capture", text(&at("moved"))]);
    assert!(moved["worst_views"].is_object(), "{moved}");
}

#[test]
fn runs_without_test_views_and_textures_have_reports() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--test-every", "0", "--policy", "none", "--set", "plan=[[4, 9]]"];
    let run = trained(folder.path(), "run", &more);
    // As if the training had been killed.
    std::fs::remove_file(run.join("summary.json")).unwrap();
    let page = folder.path().join("page.html");
    let found = report(&run, &page, &[]);
    assert_eq!(found["worst_views"]["are_training"], true);
    assert_eq!(found["worst_views"]["views"].as_array().unwrap().len(), 3);
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("The capture has no test views") && html.contains("0 texels"));
    // It has the 9 steps that its plan left of 12.
    assert!(run.join("checkpoints/step-000009.safetensors").exists());
    assert!(!html.contains("the training was interrupted"));
}

#[test]
fn inspect_ends_with_a_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let capture = |name: &str, views: &str| {
        let path = folder.path().join(name);
        let args = ["sample", text(&path), "--views", views, "--size", "160x120", "--points", "400"];
        good(&[&args[..], &["--no-truth", "-q"]].concat());
        path
    };
    let [few, more] = [capture("few", "3"), capture("more", "12")];
    let printed = good(&["inspect", text(&few), "-q"]);
    let end: Vec<&str> = printed.lines().skip_while(|line| !line.starts_with("verdict: ")).collect();
    assert_eq!(end[0], "verdict: shoot again", "{printed}");
    assert!((2..=4).contains(&end.len()) && end[1].contains("training views: take more photos"), "{printed}");
    let verdict = json(&["inspect", text(&few), "-q"])["verdict"].clone();
    assert_eq!(
        (&verdict["rating"], &verdict["reasons"][0]["code"]),
        (&"shoot-again".into(), &"few-views".into())
    );
    // Negative control: with more views the verdict is another.
    assert_eq!(json(&["inspect", text(&more), "-q"])["verdict"]["rating"], "usable");
    assert!(good(&["inspect", "--help"]).contains("verdict"));
}
