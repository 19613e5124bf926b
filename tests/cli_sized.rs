//! Runs that end with a file of a wanted size.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::cli::{bad, good, json};
use litetex_gs::train::charge::Charge;
use std::fs;

/// A folder with a capture of 9 images, 2 of them held out.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let capture = place.path("capture");
        good(&["sample", &capture, "--views", "9", "--size", "64x48", "--points", "300", "--no-truth", "-q"]);
        place
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    /// Arguments of a training into the folder `run`.
    fn training<'a>(capture: &'a str, run: &'a str, more: &[&'a str]) -> Vec<&'a str> {
        [&["train", capture, "-o", run, "--device", "cpu", "--steps", "240", "-q"], more].concat()
    }

    /// PSNR of a file against the scene of the run, dB.
    fn psnr(&self, file: &str) -> f64 {
        let (file, run) = (self.path(file), self.path("run"));
        let verify = ["verify", &file, "--against", &run, "-q", "--device", "cpu", "--max-loss", "9dB"];
        json(&verify)["verdict"]["psnr"].as_f64().unwrap()
    }
}

#[test]
fn a_run_of_a_wanted_size_ends_with_that_file() {
    let place = Place::new();
    let [capture, run, again, small, repeated] =
        ["capture", "run", "again.ltgs", "small.ltgs", "repeated"].map(|name| place.path(name));
    good(&Place::training(&capture, &run, &["--max-size", "16kB"]));
    let bytes = fs::read(place.path("run/scene.ltgs")).unwrap();
    assert!((15_200..=16_000).contains(&bytes.len()), "{} bytes", bytes.len());
    // The model of the run is the scene of the file.
    let psnr = place.psnr("run/scene.ltgs");
    assert!(psnr > 80.0, "{psnr}");
    // An export without a goal of its own is that file.
    good(&["export", &run, &again, "-q", "--device", "cpu"]);
    assert_eq!(fs::read(&again).unwrap().len(), bytes.len());
    // Negative control: a smaller one has lost something.
    good(&["export", &run, &small, "--max-loss", "1dB", "-q", "--device", "cpu"]);
    let psnr = place.psnr("small.ltgs");
    assert!(psnr < 60.0, "{psnr}");
    // Repeated from its settings, the same bytes.
    let config = place.path("run/config.toml");
    good(&["train", "--config", &config, "-o", &repeated, "--device", "cpu", "-q"]);
    assert_eq!(fs::read(place.path("repeated/scene.ltgs")).unwrap(), bytes);
    // Nothing is left to train for another size.
    let settings = fs::read(&config).unwrap();
    let (code, message) = bad(&["train", "--resume", &run, "--max-size", "12kB", "--device", "cpu", "-q"]);
    assert!(code == 2 && message.contains("has all of its 240 steps"), "{code}: {message}");
    let now = |file: &str| fs::read(place.path(file)).unwrap();
    assert!(now("run/scene.ltgs") == bytes && now("run/config.toml") == settings, "the run is as it was");
}

#[test]
fn splats_without_textures_have_files_of_a_wanted_size_too() {
    let place = Place::new();
    let [capture, run] = ["capture", "run"].map(|name| place.path(name));
    good(&Place::training(&capture, &run, &["--max-size", "12kB", "--policy", "plain"]));
    let bytes = fs::metadata(place.path("run/scene.ltgs")).unwrap().len();
    assert!((11_400..=12_000).contains(&bytes), "{bytes}");
    let psnr = place.psnr("run/scene.ltgs");
    assert!(psnr > 80.0, "{psnr}");
    assert_eq!(json(&["inspect", &run])["checkpoint"]["model"]["texels"].as_u64(), Some(0));
}

#[test]
fn runs_that_prune_nothing_begin_with_what_their_file_holds() {
    let place = Place::new();
    let [capture, run] = ["capture", "run"].map(|name| place.path(name));
    let train = |policy, more: &[&str]| {
        let how = ["--max-size", "40kB", "--policy", policy, "--init", "random", "--force", "--json"];
        good(&Place::training(&capture, &run, &[&how, more].concat()));
        let summary: serde_json::Value =
            serde_json::from_slice(&fs::read(place.path("run/summary.json")).unwrap()).unwrap();
        let warnings = summary["warnings"].as_array().unwrap();
        let bounded = warnings.iter().find(|warning| warning["code"] == "start-bounded-by-budget").unwrap();
        let message = bounded["message"].as_str().unwrap();
        let count = message.split("leaves room for ").nth(1).and_then(|rest| rest.split(' ').next());
        let splats: f64 = count.unwrap().replace(',', "").parse().unwrap();
        (splats, fs::metadata(place.path("run/scene.ltgs")).unwrap().len())
    };
    let degree_1 = Charge::UNPRUNED_BYTES.of(1, 0);
    for policy in ["litetex", "plain"] {
        let (splats, bytes) = train(policy, &["--set", "density.prune-db=0"]);
        assert!((36_000.0..40_000.0).contains(&(splats * degree_1)), "{policy}: {splats} splats");
        assert!((38_000..=40_000).contains(&bytes), "{policy}: {bytes} bytes");
    }
    // Negative control: pruning leaves room for a start that is larger than the file.
    let (splats, _) = train("plain", &[]);
    assert!(splats * degree_1 > 100_000.0, "{splats} splats");
}

#[test]
fn a_size_that_is_too_small_is_refused_with_the_smallest_which_has_room() {
    let place = Place::new();
    let [capture, run] = ["capture", "run"].map(|name| place.path(name));
    let (code, message) = bad(&Place::training(&capture, &run, &["--max-size", "1kB"]));
    assert_eq!(code, 2, "{message}");
    let smallest = message.split("too small for this capture, whose smallest file has ").nth(1);
    let least: u64 =
        smallest.unwrap_or_else(|| panic!("{message}")).split(' ').next().unwrap().parse().unwrap();
    assert!(!std::path::Path::new(&run).exists(), "nothing is left behind");
    good(&Place::training(&capture, &run, &["--max-size", &format!("{least}B")]));
    assert!(fs::metadata(place.path("run/scene.ltgs")).unwrap().len() <= least);
}

#[test]
fn effort_brings_a_file_of_a_wanted_size_nearer_to_the_scene() {
    let place = Place::new();
    let [capture, run] = ["capture", "run"].map(|name| place.path(name));
    good(&Place::training(&capture, &run, &[]));
    let [open, closed, more] = ["1", "2", "6"].map(|effort| {
        let name = format!("{effort}.ltgs");
        let file = place.path(&name);
        let how = ["--max-size", "14kB", "--effort", effort, "-q", "--device", "cpu", "--no-verify"];
        good(&[&["export", &run, &file][..], &how].concat());
        assert!(fs::metadata(&file).unwrap().len() <= 14_000);
        place.psnr(&name)
    });
    assert!(closed > open && more >= closed, "{open} {closed} {more}");
}
