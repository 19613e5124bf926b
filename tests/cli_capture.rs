//! `litetex train` on faulty captures and files: reported before the first step where possible, otherwise with a way to
//! continue.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::{TempDir, tempdir};

fn litetex() -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("litetex"));
    command.stdin(Stdio::null());
    command
}

/// A capture of 9 photos, of which the first and the last are held out.
fn capture() -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join("capture");
    let sample = litetex()
        .args(["sample", path.to_str().unwrap(), "--views", "9", "--size", "64x48", "--points", "300"])
        .args(["--no-truth", "-q"])
        .stdout(Stdio::null())
        .status();
    assert!(sample.unwrap().success());
    (folder, path)
}

fn train(capture: &Path, arguments: &[&str]) -> Command {
    let mut command = litetex();
    command.arg("train").arg(capture).args(["-o", capture.with_file_name("run").to_str().unwrap()]);
    command.args(["--device", "cpu"]).args(arguments);
    command
}

/// Exit code and standard error.
fn outcome(command: &mut Command) -> (Option<i32>, String) {
    let output = command.output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

fn held_out(capture: &Path) -> PathBuf {
    let mut photos: Vec<PathBuf> =
        std::fs::read_dir(capture.join("images")).unwrap().map(|e| e.unwrap().path()).collect();
    photos.sort();
    photos.swap_remove(0)
}

fn truncate(path: &Path) {
    let whole = std::fs::read(path).unwrap();
    std::fs::write(path, &whole[..whole.len() / 2]).unwrap();
}

#[test]
fn a_truncated_held_out_photo_is_refused_before_training() {
    let (_folder, capture) = capture();
    let photo = held_out(&capture);
    truncate(&photo);
    let (code, text) = outcome(&mut train(&capture, &["--steps", "20"]));
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains(photo.file_name().unwrap().to_str().unwrap()), "{text}");
    assert!(!capture.with_file_name("run").exists(), "nothing is left behind");
}

#[test]
fn a_photo_that_breaks_during_training_loses_no_progress() {
    let (_folder, capture) = capture();
    let run = capture.with_file_name("run");
    let mut training = train(&capture, &["--steps", "1200", "--set", "capture.image-cache-bytes=1024"]);
    let training = training.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let started = Instant::now();
    // The photos have been checked when the run's folder is there.
    while !std::fs::read_to_string(run.join("metrics.jsonl")).is_ok_and(|t| t.contains("\"started\"")) {
        assert!(started.elapsed() < Duration::from_secs(120), "the training does not begin");
        std::thread::sleep(Duration::from_millis(5));
    }
    let photo = held_out(&capture);
    let whole = std::fs::read(&photo).unwrap();
    truncate(&photo);
    let output = training.wait_with_output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{text}");
    let resume = format!("--resume {}", run.display());
    assert!(text.contains(&resume) && text.contains("step-001200"), "{text}");
    std::fs::write(&photo, whole).unwrap();
    let mut again = litetex();
    again.args(["train", "--resume", run.to_str().unwrap(), "--device", "cpu"]);
    let (code, text) = outcome(&mut again);
    assert_eq!(code, Some(0), "{text}");
    assert!(run.join("eval/001200").is_dir() && run.join("summary.json").is_file());
}

#[cfg(unix)]
#[test]
fn devices_in_place_of_files_are_refused_at_once() {
    let (_folder, capture) = capture();
    for arguments in [["--config", "/dev/zero"], ["--init", "ply:/dev/zero"], ["--test-list", "/dev/zero"]] {
        let (code, text) = outcome(&mut train(&capture, &arguments));
        assert_eq!(code, Some(3), "{arguments:?}: {text}");
        assert!(text.contains("/dev/zero: a device"), "{arguments:?}: {text}");
    }
}

/// Trains a few steps on a capture of text poses and returns the bytes of the exported model.
fn trained(capture: &Path, settings: &[&str]) -> Vec<u8> {
    let folder = tempdir().unwrap();
    let (run, model) = (folder.path().join("run"), folder.path().join("model.ply"));
    let mut training = litetex();
    training.arg("train").arg(capture).arg("-o").arg(&run);
    let (code, text) = outcome(training.args(["--device", "cpu", "--steps", "3", "-q"]).args(settings));
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = outcome(litetex().arg("export").arg(&run).arg(&model).args(["--device", "cpu", "-q"]));
    assert_eq!(code, Some(0), "{text}");
    std::fs::read(model).unwrap()
}

/// The rule against far cameras touches no capture without them.
#[test]
fn captures_without_far_cameras_train_to_the_same_bytes() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("capture");
    let sample = ["sample", path.to_str().unwrap(), "--views", "9", "--size", "32x24", "--points", "100"];
    let (code, text) = outcome(litetex().args(sample).args(["--text", "--no-truth", "-q"]));
    assert_eq!(code, Some(0), "{text}");
    for file in ["cameras.bin", "images.bin", "points3D.bin"] {
        std::fs::remove_file(path.join("sparse/0").join(file)).unwrap();
    }
    let keep_far = ["--set", "capture.keep-far=true"];
    let whole = trained(&path, &[]);
    assert!(whole == trained(&path, &keep_far), "the same bytes");
    // Negative control: one camera, 100 times too far.
    let poses = path.join("sparse/0/images.txt");
    let text = std::fs::read_to_string(&poses).unwrap();
    let line = text.lines().find(|line| line.ends_with("view_0006.png")).unwrap();
    let mut words: Vec<String> = line.split(' ').map(str::to_owned).collect();
    for word in &mut words[5..8] {
        *word = (100.0 * word.parse::<f64>().unwrap()).to_string();
    }
    std::fs::write(&poses, text.replace(line, &words.join(" "))).unwrap();
    let without = trained(&path, &[]);
    assert!(without != trained(&path, &keep_far) && without != whole);
}
