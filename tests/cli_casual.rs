//! The command on what people bring: photos with an alpha channel, few views, none held out, no poses, videos.

#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tempfile::tempdir;

/// Exit code, standard output, standard error.
fn run(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("litetex"));
    let output = command.current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
}

fn ok(folder: &Path, arguments: &[&str]) -> String {
    let (code, stdout, stderr) = run(folder, arguments);
    assert_eq!(code, 0, "{arguments:?}\n{stdout}{stderr}");
    stdout
}

/// The exit code and the message of a command that fails.
fn refused(folder: &Path, arguments: &[&str]) -> (i32, String) {
    let (code, stdout, stderr) = run(folder, arguments);
    assert_ne!(code, 0, "{arguments:?}\n{stdout}");
    (code, stderr)
}

fn sample(folder: &Path, arguments: &[&str]) {
    let all = ["sample", "capture", "--size", "64x48", "--points", "300", "--no-truth", "-q"];
    ok(folder, &[&all[..], arguments].concat());
}

/// Trains into `run`; the summary.
fn train(folder: &Path, run: &str, arguments: &[&str]) -> Value {
    ok(folder, &[&["train", "capture", "-o", run, "--device", "cpu", "-q"], arguments].concat());
    serde_json::from_slice(&std::fs::read(folder.join(run).join("summary.json")).unwrap()).unwrap()
}

fn warning(summary: &Value, code: &str) -> Option<String> {
    let all = summary["warnings"].as_array().unwrap();
    all.iter().find(|w| w["code"] == code).map(|w| w["message"].as_str().unwrap().to_owned())
}

#[test]
fn an_opaque_alpha_channel_leaves_the_backdrop_and_transparency_removes_it_with_a_warning() {
    let dir = tempdir().unwrap();
    sample(dir.path(), &["--views", "9", "--stress", "sky"]);
    let photos: Vec<_> =
        std::fs::read_dir(dir.path().join("capture/images")).unwrap().map(|e| e.unwrap().path()).collect();
    let splats = |summary: &Value| summary["size"]["splats"].as_u64().unwrap();
    let rgb = train(dir.path(), "rgb", &["--steps", "1"]);
    for photo in &photos {
        image::open(photo).unwrap().into_rgba8().save(photo).unwrap();
    }
    let opaque = train(dir.path(), "opaque", &["--steps", "1"]);
    assert_eq!(splats(&opaque), splats(&rgb));
    assert_eq!(warning(&opaque, "no-backdrop"), None);
    let mut photo = image::open(&photos[0]).unwrap().into_rgba8();
    photo.get_pixel_mut(0, 0).0[3] = 0;
    photo.save(&photos[0]).unwrap();
    let cut_out = train(dir.path(), "cut-out", &["--steps", "1"]);
    assert!(splats(&cut_out) < splats(&rgb), "negative control: {} splats", splats(&cut_out));
    assert!(warning(&cut_out, "no-backdrop").unwrap().contains("transparent"));
    let unwanted = train(dir.path(), "unwanted", &["--steps", "1", "--set", "backdrop=none"]);
    assert_eq!(warning(&unwanted, "no-backdrop"), None);
}

#[test]
fn without_test_views_the_training_views_are_judged() {
    let dir = tempdir().unwrap();
    sample(dir.path(), &["--views", "9", "--stress", "sky"]);
    // Grey, so that splats need not cover a sky that the background already shows in part.
    let all = ["--test-every", "0", "--init", "sfm", "--set", "backdrop=none", "--set", "background=#808080"];
    let bare = train(dir.path(), "bare", &[&all[..], &["--steps", "200"]].concat());
    assert_eq!(warning(&bare, "no-test-figures"), None);
    let message = warning(&bare, "uncovered-pixels").unwrap();
    assert!(message.contains("of the pixels of the training views"), "{message}");
    let covered =
        train(dir.path(), "covered", &["--test-every", "0", "--set", "background=#808080", "--steps", "200"]);
    assert_eq!(warning(&covered, "uncovered-pixels"), None, "negative control");

    let table = ok(dir.path(), &["eval", "bare", "--training", "--device", "cpu", "-q"]);
    assert!(table.contains("PSNR of the training views") && !table.contains("SSIM"), "{table}");
    let json = ok(dir.path(), &["eval", "bare", "--training", "--json", "--device", "cpu", "-q"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert!(json["quality"].is_null() && json["training"]["psnr"].as_f64().unwrap() > 5.0, "{json}");
    for more in [&[][..], &["--training", "--worst", "a.png"]] {
        let (code, text) = refused(dir.path(), &[&["eval", "bare", "--device", "cpu"], more].concat());
        assert!(code == 2 && text.contains("the capture has no test views"), "{text}");
    }
}

#[test]
fn eval_writes_the_worst_view_as_its_extension_says_and_names_what_it_expects() {
    let dir = tempdir().unwrap();
    sample(dir.path(), &["--views", "9"]);
    train(dir.path(), "run", &["--steps", "1"]);
    for (name, format) in [("a.png", image::ImageFormat::Png), ("a.JPG", image::ImageFormat::Jpeg)] {
        ok(dir.path(), &["eval", "run", "--worst", name, "--device", "cpu", "-q"]);
        let bytes = std::fs::read(dir.path().join(name)).unwrap();
        assert_eq!(image::guess_format(&bytes).unwrap(), format);
    }
    let (code, text) = refused(dir.path(), &["eval", "run", "--worst", "a.webp"]);
    assert!(code == 2 && text.contains("expected a .jpg or .png file"), "{text}");
    std::fs::write(dir.path().join("b.glb"), "").unwrap();
    let (code, text) = refused(dir.path(), &["eval", "run", "--uncovered-by", "b.glb", "--device", "cpu"]);
    assert!(code == 4 && text.contains("expected the folder of a run"), "{text}");
}

#[test]
fn eval_compares_with_photos_of_the_size_that_is_asked_for() {
    let dir = tempdir().unwrap();
    sample(dir.path(), &["--views", "9"]);
    train(dir.path(), "run", &["--steps", "20", "--max-resolution", "32"]);
    let figures = |more: &[&str]| -> Value {
        let text = ok(dir.path(), &[&["eval", "run", "--json", "--device", "cpu", "-q"], more].concat());
        serde_json::from_str(&text).unwrap()
    };
    let [own, full] = [figures(&[]), figures(&["--max-resolution", "64"])];
    let size = |json: &Value| [json["width_px"].as_u64().unwrap(), json["height_px"].as_u64().unwrap()];
    assert_eq!([size(&own), size(&full)], [[32, 24], [64, 48]]);
    assert_ne!(own["quality"]["psnr"], full["quality"]["psnr"]);
}

#[test]
fn photos_without_poses_and_videos_are_refused_with_what_to_do() {
    let dir = tempdir().unwrap();
    for name in ["a.HEIC", "clip.mp4", "videos/b.mov"] {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }
    let archive = std::fs::File::create(dir.path().join("x.zip")).unwrap();
    let mut archive = zip::ZipWriter::new(archive);
    archive.start_file("photos/1.jpg", zip::write::SimpleFileOptions::default()).unwrap();
    archive.finish().unwrap();
    for (source, command) in [
        (".", "litetex capture"),
        ("a.HEIC", "litetex capture"),
        ("clip.mp4", "litetex capture"),
        ("videos", "litetex capture"),
        ("x.zip", "unpack it, and \"litetex capture FOLDER -o CAPTURE\" finds them"),
    ] {
        let (code, text) = refused(dir.path(), &["train", source, "-o", "run"]);
        assert!([3, 4].contains(&code) && text.contains(command), "{source}: {text}");
        assert_eq!(text.contains("\n  litetex train "), source != "x.zip", "{source}: {text}");
    }
}

#[test]
fn the_script_that_makes_casual_captures_refuses_what_it_cannot_make() {
    let dir = tempdir().unwrap();
    sample(dir.path(), &["--views", "9"]);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/casual_captures.py");
    let made = |capture: &str| {
        let mut python = Command::new("python3");
        let output = python.current_dir(dir.path()).args([script, "out", capture]).output().ok()?;
        Some((output.status.success(), String::from_utf8(output.stderr).unwrap()))
    };
    for (capture, what) in [
        ("a=capture:banana", "unknown kind 'banana'"),
        ("a=capture/images", "expected a COLMAP capture"),
        ("capture", "expected NAME=CAPTURE"),
    ] {
        let Some((success, text)) = made(capture) else {
            println!("skipped: no python3");
            return;
        };
        assert!(!success && text.contains(what) && !dir.path().join("out").exists(), "{text}");
    }
    assert_eq!(made("a=capture:third,points"), Some((true, String::new())));
    let matrix = std::fs::read_to_string(dir.path().join("out/matrix.toml")).unwrap();
    let folder = dir.path().canonicalize().unwrap().join("out/a-third");
    assert!(matrix.contains(&folder.display().to_string()) && folder.join("test.txt").exists(), "{matrix}");
}
