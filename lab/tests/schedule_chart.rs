//! `litetex-lab schedule-chart` on the schedule of a small sample capture.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

mod common;

use common::{ok, run};
use std::fs;

/// A folder with a capture of 5 images, one of them held out, and its schedule.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let size = ["--size", "320x240", "--points", "50", "--no-truth", "-q"];
        ok(&[&["sample", &place.path("capture"), "--views", "5"], &size[..]].concat());
        place.plan(&[]);
        place
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    /// Writes the schedule.
    fn plan(&self, arguments: &[&str]) {
        let json = ok(&[&["schedule", &self.path("capture"), "--json", "-q"], arguments].concat());
        fs::write(self.path("plan.json"), json).unwrap();
    }
}

#[test]
fn charts_are_complete_and_not_replaced_without_force() {
    let place = Place::new();
    let (plan, chart) = (place.path("plan.json"), place.path("chart.svg"));
    let draw = ["schedule-chart", &plan, "-o", &chart];
    ok(&draw);
    let text = fs::read_to_string(&chart).unwrap();
    assert!(text.starts_with("<svg ") && text.ends_with("</svg>\n") && !text.contains("NaN"), "{text}");
    assert!(text.contains("prefers-color-scheme:dark"));
    assert!(text.contains("Frequency schedule of capture") && text.contains(">20k<"));
    // Both panels mark 15,000 and 20,000 of 30,000 steps, at the same places.
    let number = |line: &str, key: &str| -> f64 {
        line.split(&format!(" {key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    let x_of = |part: &str, key: &str| -> Vec<f64> {
        text.lines().filter(|l| l.contains(part)).map(|l| number(l, key)).collect()
    };
    let (events, ticks) = (x_of("<line class=\"lt-event\"", "x1"), [">10k<", ">20k<"].map(|t| x_of(t, "x")));
    assert_eq!(events.len(), 4);
    assert_eq!(events[..2], events[2..]);
    let [ten, twenty] = ticks.map(|x| x[0]);
    assert!((events[0] - 0.5 * (ten + twenty)).abs() < 0.2 && (events[1] - twenty).abs() < 0.2, "{events:?}");
    for (event, meaning) in [(0, "densification ends"), (1, "full size from here")] {
        let words = x_of(meaning, "x");
        assert!(words.len() == 1 && (words[0] - events[event] - 6.0).abs() < 0.2, "{meaning}: {words:?}");
    }
    place.plan(&["--steps", "600"]);
    let (code, stdout, stderr) = run(&draw);
    assert!(code == 2 && stdout.is_empty() && stderr.contains("--force"), "{code} {stderr}");
    assert_eq!(fs::read_to_string(&chart).unwrap(), text);
    ok(&[&draw[..], &["--force"]].concat());
    assert!(fs::read_to_string(&chart).unwrap().contains(">600<"));
    // The capture, the schedule and the chart, nothing half-written.
    assert_eq!(fs::read_dir(place.0.path()).unwrap().count(), 3);
}

#[cfg(unix)]
#[test]
fn a_pipe_is_not_replaced_by_a_chart() {
    use std::os::unix::fs::FileTypeExt;
    let place = Place::new();
    let pipe = place.path("chart.svg");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let (code, stdout, stderr) = run(&["schedule-chart", &place.path("plan.json"), "-o", &pipe, "--force"]);
    assert!(code == 2 && stdout.is_empty() && stderr.contains("a device or a pipe"), "{code} {stderr}");
    assert!(fs::symlink_metadata(&pipe).unwrap().file_type().is_fifo());
}

#[test]
fn other_files_are_refused() {
    let place = Place::new();
    fs::write(place.path("plan.json"), "{}").unwrap();
    let (code, _, stderr) =
        run(&["schedule-chart", &place.path("plan.json"), "-o", &place.path("chart.svg")]);
    assert!(
        code == 3 && stderr.contains("plan.json") && stderr.contains("litetex schedule"),
        "{code} {stderr}"
    );
}
