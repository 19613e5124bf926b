//! Files with a stand-in, a small scene that is shown while they arrive.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::cli::{bad, good, json, litetex};
use serde_json::Value;
use std::fs;

/// A folder with a run of a few steps, of 3,000 splats.
struct Place(tempfile::TempDir);

impl Place {
    fn new(steps: &str, more: &[&str]) -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let [capture, run] = ["capture", "run"].map(|name| place.path(name));
        good(&[
            "sample",
            &capture,
            "--views",
            "8",
            "--size",
            "96x72",
            "--points",
            "3000",
            "--no-truth",
            "-q",
        ]);
        let train = ["train", &capture, "-o", &run, "--device", "cpu", "--steps", steps, "-q"];
        good(&[&train[..], more].concat());
        place
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    /// Exports the run; what the program says of the file.
    fn export(&self, file: &str, more: &[&str]) -> Value {
        let (run, file) = (self.path("run"), self.path(file));
        let export = ["export", &run, "-o", &file, "-q", "--device", "cpu", "--force"];
        json(&[&export[..], more].concat())["files"][0].clone()
    }

    fn inspect(&self, file: &str) -> Value {
        json(&["inspect", &self.path(file)])
    }

    fn bytes(&self, file: &str) -> u64 {
        fs::metadata(self.path(file)).unwrap().len()
    }
}

#[test]
fn a_stand_in_looks_like_the_scene_and_leaves_it_as_it_is() {
    let place = Place::new("40", &[]);
    place.export("plain.ltgs", &["--quality", "lossless"]);
    let written = place.export("scene.ltgs", &["--quality", "lossless", "--preview"]);
    let (plain, found) = (place.inspect("plain.ltgs"), place.inspect("scene.ltgs"));
    assert_eq!((&plain["stand_in"], &plain["hash"]), (&Value::Null, &found["hash"]));
    let stand_in = &found["stand_in"];
    let figure = |of: &Value, name: &str| of[name].as_u64().unwrap();
    let own = figure(stand_in, "bytes");
    assert!(12 * own <= place.bytes("scene.ltgs") && 24 * own > place.bytes("scene.ltgs"), "{found}");
    assert!((100..3_000).contains(&figure(stand_in, "splats")), "{found}");
    assert_eq!(figure(&written["stand_in"], "until_bytes"), figure(stand_in, "until_bytes"));
    assert!(figure(stand_in, "until_bytes") <= figure(&written["stand_in"], "scene_bytes"));
    // Measured: 31.6 dB.
    let psnr = written["stand_in"]["psnr_to_scene"].as_f64().unwrap();
    assert!(psnr > 28.0, "{psnr}");
    // Made again, the same bytes.
    place.export("again.ltgs", &["--quality", "lossless", "--preview"]);
    assert!(fs::read(place.path("again.ltgs")).unwrap() == fs::read(place.path("scene.ltgs")).unwrap());
    // It can be rendered and taken out, and is no part of what is made of the file.
    let [file, small, images, copy] =
        ["scene.ltgs", "small.ltgs", "images", "copy.ltgs"].map(|name| place.path(name));
    good(&["render", &file, "--test", "--layers", "0", "-o", &images, "-q", "--device", "cpu"]);
    good(&["convert", &file, &small, "--layers", "0", "--quality", "lossless", "-q", "--device", "cpu"]);
    let taken = place.inspect("small.ltgs");
    assert_eq!(
        (&taken["cameras"], figure(&taken["model"], "splats")),
        (&found["cameras"], figure(stand_in, "splats"))
    );
    good(&["convert", &file, &copy, "--quality", "lossless", "-q", "--device", "cpu"]);
    assert_eq!(fs::read(&copy).unwrap(), fs::read(place.path("plain.ltgs")).unwrap());
    let (code, message) = bad(&["render", &copy, "--test", "--layers", "0", "-o", &images, "--force", "-q"]);
    assert!(code == 2 && message.contains("has no stand-in; export one with --preview"), "{message}");
}

#[test]
fn what_cannot_have_a_stand_in_is_written_without_one_and_says_so() {
    let place = Place::new("3", &[]);
    for (file, quality, why) in [
        ("small.ltgs", "tiny", "below 100 kB"),
        ("scene.glb", "balanced", "only .ltgs files"),
        ("scene.html", "tiny", "only .ltgs files"),
    ] {
        let (run, path) = (place.path("run"), place.path(file));
        let export = ["export", &run, "-o", &path, "--device", "cpu", "--quality", quality, "--preview"];
        let output = litetex(&export);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.contains("no-stand-in") && said.contains(why), "{said}");
        assert_eq!(place.inspect(file)["stand_in"], Value::Null);
    }
}

#[test]
fn a_run_of_a_wanted_size_leaves_room_for_the_stand_in() {
    let place = Place::new("60", &["--max-size", "100kB", "--set", "preview=true"]);
    let found = place.inspect("run/scene.ltgs");
    assert!(place.bytes("run/scene.ltgs") <= 100_000, "{found}");
    assert!(found["stand_in"]["bytes"].as_u64().unwrap() > 7_000, "{found}");
    // So does an export.
    place.export("scene.ltgs", &["--max-size", "100kB", "--preview"]);
    assert!((90_000..=100_000).contains(&place.bytes("scene.ltgs")));
    assert_ne!(place.inspect("scene.ltgs")["stand_in"], Value::Null);
}
