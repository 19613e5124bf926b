//! `litetex train --view`: the page follows the training, and the training does not notice.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::cli::{good, text};
use common::page::Page;
use litetex_exporters::{ReadLimits, ltgs};
use std::path::{Path, PathBuf};

struct Place(tempfile::TempDir);

impl Place {
    /// With a capture of 9 photos.
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let capture = place.at("capture");
        good(&[
            "sample",
            text(&capture),
            "--views",
            "9",
            "--size",
            "64x48",
            "--points",
            "300",
            "--no-truth",
            "-q",
        ]);
        place
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Trains with a page.
    fn live(&self, run: &str, steps: &str, more: &[&str]) -> Page {
        let (capture, run) = (self.at("capture"), self.at(run));
        let args = ["train", text(&capture), "-o", text(&run), "--device", "cpu", "--steps", steps];
        Page::start(&[&args[..], &["--view=no-open"], more].concat())
    }
}

/// Splats and step of the preview that is served.
fn preview(page: &Page) -> (usize, String) {
    let bytes = page.data("asset").body;
    let asset = ltgs::decode(&bytes, Path::new("preview"), &ReadLimits::default()).unwrap().asset;
    (asset.num_splats(), asset.provenance.training["steps"].clone())
}

#[test]
fn the_page_follows_a_training_and_stays() {
    let place = Place::new();
    let page = place.live("run", "1500", &["--set", "eval-every=500"]);
    let session = page.wait_for("a preview", |session| !session["asset"].is_null());
    assert_eq!(session["title"], "capture");
    assert_eq!(session["photos"].as_array().unwrap().len(), 9);
    let file = place.at("run/preview.ltgs");
    let (splats, step) = preview(&page);
    assert!(splats >= 250 && step.parse::<u32>().unwrap() < 1500, "{splats} {step}");
    let first = session["training"]["step"].as_u64().unwrap_or(0);
    let session = page.wait_for("steps", |session| session["training"]["step"].as_u64() > Some(first));
    if session["training"]["state"] == "running" {
        assert!(file.is_file() && session["training"]["etaSecs"].as_f64() > Some(0.0), "{session}");
    }
    let done = page.wait_for("the end", |session| {
        session["training"]["state"] == "finished" && session["asset"]["name"] == "step-001500.safetensors"
    });
    assert!(!file.exists(), "the checkpoint takes its place");
    assert_eq!((&done["training"]["step"], &done["training"]["curveOf"]), (&1500.into(), &"psnr".into()));
    assert!(
        done["training"]["splats"].as_u64() > Some(200) && done["training"]["etaSecs"].is_null(),
        "{done}"
    );
    assert_eq!(preview(&page).1, "1500");
    #[cfg(unix)]
    {
        page.signal("INT");
        let (code, message) = page.end();
        assert_eq!(code, Some(0), "{message}");
        assert!(message.contains("the viewer stays open"), "{message}");
    }
}

#[test]
fn a_training_with_a_page_gives_the_same_model() {
    let place = Place::new();
    let (capture, plain) = (place.at("capture"), place.at("plain"));
    let model = |run: &str| std::fs::read(place.at(run).join("checkpoints/step-000400.safetensors")).unwrap();
    good(&["train", text(&capture), "-o", text(&plain), "--device", "cpu", "--steps", "400", "-q"]);
    let page = place.live("live", "400", &["-q"]);
    // Reads all the time, and photos with it.
    let mut previews = 0;
    let mut number = 0;
    loop {
        let session = page.session();
        assert_eq!(page.data(&format!("photo/{}", number % 9)).status, 200);
        number += 1;
        if session["asset"]["name"].as_str().is_some_and(|name| name.starts_with("step ")) {
            previews += 1;
            assert!(preview(&page).0 > 0);
        }
        if session["asset"]["name"] == "step-000400.safetensors" {
            break;
        }
    }
    assert!(previews > 0, "negative control: there were previews");
    assert!(model("live") == model("plain"));
    drop(page);
    let other = place.at("other");
    good(&[
        "train",
        text(&capture),
        "-o",
        text(&other),
        "--device",
        "cpu",
        "--steps",
        "400",
        "--seed",
        "7",
        "-q",
    ]);
    assert!(model("other") != model("plain"), "negative control");
}

#[cfg(unix)]
#[test]
fn a_killed_training_is_told() {
    let place = Place::new();
    let run = place.at("run");
    let live = place.live("run", "100000", &[]);
    live.wait_for("a preview", |session| !session["asset"].is_null());
    let page = Page::start(&["view", text(&run), "--no-open"]);
    let session = page.wait_for("steps", |session| session["training"]["step"].as_u64() >= Some(10));
    assert_eq!(
        (&session["training"]["state"], &session["asset"]["name"]),
        (&"running".into(), &"preview.ltgs".into())
    );
    assert_eq!(session["training"]["steps"], 100_000);
    live.signal("KILL");
    assert_eq!(live.end().0, None, "killed");
    let session = page.wait_for("the end", |session| session["training"]["state"] == "stopped");
    assert!(session["training"]["etaSecs"].is_null());
    assert!(preview(&page).0 > 0, "what was shown last stays");
    drop(page);
    // Also when it is opened only now; continuing the run is refused for want of a checkpoint, not of a lock.
    let page = Page::start(&["view", text(&run), "--no-open"]);
    assert_eq!(page.session()["training"]["state"], "stopped");
    assert!(preview(&page).0 > 0);
}

#[cfg(unix)]
#[test]
fn ctrl_c_during_training_saves_and_ends() {
    let place = Place::new();
    let page = place.live("run", "100000", &[]);
    page.wait_for("steps", |session| session["training"]["step"].as_u64() >= Some(5));
    page.signal("INT");
    let (code, message) = page.end();
    assert_eq!(code, Some(130), "{message}");
    assert!(message.contains("--resume") && !place.at("run/preview.ltgs").exists(), "{message}");
    let page = Page::start(&["view", text(&place.at("run")), "--no-open"]);
    let session = page.session();
    assert_eq!(session["training"]["state"], "stopped");
    assert!(session["asset"]["name"].as_str().unwrap().ends_with(".safetensors"), "{session}");
}
