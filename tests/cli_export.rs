//! Assets from the command line: every format and quality is written, proven, read and compared; what is wrong is
//! told with the exit code of its family.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use assert_cmd::Command;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::OnceLock;

/// A short run on a small sample, made once.
fn run_folder() -> &'static Path {
    static RUN: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, run) = RUN.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let (capture, run) = (folder.path().join("capture"), folder.path().join("run"));
        good(&["sample", text(&capture), "--size", "96x64", "--views", "16"]);
        good(&[
            "train",
            text(&capture),
            "-o",
            text(&run),
            "--steps",
            "200",
            "--device",
            "cpu",
            "-q",
            "--max-points",
            "400",
        ]);
        (folder, run)
    });
    run
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn litetex(args: &[&str]) -> Output {
    Command::cargo_bin("litetex").unwrap().args(args).output().unwrap()
}

fn good(args: &[&str]) -> String {
    let output = litetex(args);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{args:?}: {told}");
    String::from_utf8(output.stdout).unwrap()
}

/// Exit code and message.
fn bad(args: &[&str]) -> (i32, String) {
    let output = litetex(args);
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn json(args: &[&str]) -> serde_json::Value {
    serde_json::from_str(&good(&[args, &["--json"]].concat())).unwrap()
}

#[test]
fn lossless_files_of_all_formats_render_without_any_difference() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let files = ["a.glb", "b.gltf", "c.ltgs", "d.usda", "e.usdc", "f.usdz"].map(|f| folder.path().join(f));
    let names: Vec<&str> = files.iter().map(|f| text(f)).collect();
    let told = good(
        &[&["export", text(run), "--quality", "lossless", "--device", "cpu", "-o"], &names[..]].concat(),
    );
    assert_eq!(told.matches(" same ").count(), 6, "{told}");
    assert_eq!(told.matches(" yes").count(), 6, "{told}");
    let mut hashes = Vec::new();
    for file in &names {
        let verdict = json(&["verify", file, "--against", text(run), "--device", "cpu"]);
        assert_eq!(verdict["verdict"]["largest"], 0.0, "{file}: {verdict}");
        assert!(verdict["verdict"]["fallback_psnr"].as_f64().unwrap() < 60.0, "textures are seen");
        assert_eq!(json(&["validate", file])["valid"], true);
        let found = json(&["inspect", file]);
        assert_eq!((&found["quality"], &found["cameras"]), (&"lossless".into(), &16.into()));
        assert_eq!(found["provenance"]["training"]["steps"], "200");
        hashes.push(found["hash"].as_str().unwrap().to_owned());
    }
    assert!(hashes.iter().all(|h| h == &hashes[0]), "{hashes:?}");
    // There and back.
    let again = folder.path().join("again.glb");
    good(&["convert", text(&files[2]), text(&again), "--quality", "lossless", "--device", "cpu"]);
    assert_eq!(json(&["inspect", text(&again)])["hash"], hashes[0].as_str());
    // Negative control: another scene.
    let half = folder.path().join("half.ltgs");
    good(&[
        "export",
        text(run),
        "-o",
        text(&half),
        "--quality",
        "lossless",
        "--device",
        "cpu",
        "--min-contribution",
        "30",
    ]);
    let (code, told) = bad(&["verify", text(&half), "--against", text(run), "--device", "cpu"]);
    assert!(code == 1 && told.contains("no difference"), "{told}");
}

#[test]
fn lossy_files_keep_what_they_promise_and_plain_ones_the_colours() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    for (name, quality) in [
        ("a.glb", "balanced"),
        ("b.ltgs", "balanced"),
        ("c.usdz", "balanced"),
        ("d.ltgs", "tiny"),
        ("e.ply", "tiny"),
        ("f.spz", "tiny"),
    ] {
        let file = at(name);
        good(&["export", text(run), "-o", text(&file), "--quality", quality, "--device", "cpu"]);
        let verdict = json(&["verify", text(&file), "--against", text(run), "--device", "cpu"]);
        assert_eq!(verdict["verified"], true, "{name}: {verdict}");
        let v = &verdict["verdict"];
        assert!(v["on_test_photos"]["before"].as_f64().unwrap() > 10.0, "the capture is there");
        assert_eq!(v["untextured"], ["e.ply", "f.spz"].contains(&name));
        println!("{name} {quality}: {} dB, {} dB lost", v["psnr"], v["loss_db"]);
    }
    let size = |name: &str| std::fs::metadata(at(name)).unwrap().len();
    assert!(size("d.ltgs") < size("b.ltgs") && size("b.ltgs") < size("a.glb"));
    // A size is kept to, and one that is too small is refused.
    let most = (size("d.ltgs") * 9 / 10).to_string();
    let small = at("small.ltgs");
    good(&[
        "export",
        text(run),
        "-o",
        text(&small),
        "--quality",
        "tiny",
        "--max-size",
        &most,
        "--device",
        "cpu",
    ]);
    assert!(size("small.ltgs") <= size("d.ltgs") * 9 / 10 && size("small.ltgs") > size("d.ltgs") * 7 / 10);
    // More may be lost than any quality promises, if that is what was asked for.
    let coarse = at("coarse.ltgs");
    good(&["export", text(run), "-o", text(&coarse), "--max-loss", "1dB", "--device", "cpu"]);
    let (code, told) = bad(&["verify", text(&coarse), "--against", text(run), "--device", "cpu"]);
    assert!(code == 1 && told.contains("at most 0.1"), "{told}");
    let (code, told) = bad(&["export", text(run), "-o", text(&at("no.glb")), "--max-loss", "1dB"]);
    assert!(code == 2 && told.contains(".ltgs"), "{told}");
    let (code, told) = bad(&["export", text(run), "-o", text(&at("no.ltgs")), "--max-size", "500B"]);
    assert!(code == 2 && told.contains("--max-size") && !at("no.ltgs").exists(), "{told}");
}

#[test]
fn scenes_are_cut_turned_and_named() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let file = folder.path().join("a.usdz");
    let whole = json(&["inspect", text(run)])["checkpoint"]["model"].clone();
    let middle = |axis: usize| {
        let of = |side: &str| whole["bounds_in_capture"][side][axis].as_f64().unwrap();
        0.5 * (of("min") + of("max"))
    };
    let cut = format!("{},-1e9,-1e9:1e9,1e9,1e9", middle(0));
    good(&[
        "export",
        text(run),
        "-o",
        text(&file),
        "--crop",
        &cut,
        "--up",
        "z",
        "--scale",
        "2",
        "--author",
        "Ann",
        "--title",
        "Half",
        "--licence",
        "CC0-1.0",
        "--device",
        "cpu",
    ]);
    let found = json(&["inspect", text(&file)]);
    let count = |v: &serde_json::Value| v["primitives"].as_u64().unwrap();
    assert!(count(&found["model"]) > 0 && count(&found["model"]) < count(&whole));
    assert_eq!(
        (&found["provenance"]["author"], &found["provenance"]["title"]),
        (&"Ann".into(), &"Half".into())
    );
    // x stays, doubled; z is where -y was.
    assert!(found["model"]["bounds_in_capture"]["min"][0].as_f64().unwrap() >= 2.0 * middle(0) - 1e-6);
    assert_ne!(found["rotation_of_frame"][0], 1.0);
}

#[test]
fn what_cannot_be_is_refused_before_anything_is_written() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let cases: [(&[&str], i32, &str); 7] = [
        (&["-o", "x.obj"], 4, "known: .glb"),
        (&["-o", "x.glb", "--quality", "tiny"], 4, "lossless and balanced"),
        (&["-o", "x.ltgs", "x.ltgs"], 2, "named twice"),
        (&["-o", "x.ltgs", "--up", "w"], 2, "--up"),
        (&["-o", "x.ltgs", "--crop", "9e8,9e8,9e8:1e9,1e9,1e9"], 2, "leave no splat"),
        (&["-o", "x.ltgs", "--quality", "lossless", "--max-size", "1MB"], 2, "--max-size"),
        (&["-o", "x.ltgs", "--device", "no-such"], 4, "no-such"),
    ];
    for (args, code, word) in cases {
        let args: Vec<String> = args
            .iter()
            .map(|a| if a.contains("x.") { text(&at(a)).to_owned() } else { (*a).to_owned() })
            .collect();
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        let (found, told) = bad(&[&["export", text(run)], &args[..]].concat());
        assert!(found == code && told.contains(word), "{args:?}: {found} {told}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was left behind");
    let file = at("a.ply");
    std::fs::write(&file, "mine").unwrap();
    let (code, told) = bad(&["export", text(run), "-o", text(&file)]);
    assert!(code == 2 && told.contains("--force"), "{told}");
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    let (code, told) = bad(&["verify", text(&file), "--against", text(run)]);
    assert!(code == 3 && told.contains("a.ply"), "{told}");
    let (code, _) = bad(&["validate", text(&file)]);
    assert_eq!(code, 1);
}

#[test]
fn pictures_folders_and_scenes_are_compared() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let glb = at("a.glb");
    good(&["export", text(run), "-o", text(&glb), "--quality", "lossless", "--no-verify"]);
    good(&["render", text(run), "--test", "-o", text(&at("run")), "--device", "cpu"]);
    good(&["render", text(&glb), "--test", "-o", text(&at("asset")), "--device", "cpu"]);
    let same = json(&["compare", text(&at("run")), text(&at("asset"))]);
    assert_eq!((&same["psnr"], &same["per_view"].as_array().unwrap().len()), (&100.0.into(), &2));
    let scenes = json(&["compare", text(&glb), text(run), "--views", "3", "--device", "cpu"]);
    assert_eq!(scenes["per_view"][2]["largest"], 0.0);
    let pictures: Vec<PathBuf> = std::fs::read_dir(at("run")).unwrap().map(|e| e.unwrap().path()).collect();
    let (code, told) = bad(&["compare", text(&pictures[0]), text(&pictures[1]), "--min-psnr", "60dB"]);
    assert!(code == 1 && told.contains("60"), "{told}");
    let (code, _) = bad(&["compare", text(&pictures[0]), text(&glb)]);
    assert_eq!(code, 2);
    let (code, told) = bad(&["compare", text(&at("run")), text(folder.path())]);
    assert!(code == 2 && told.contains("no picture"), "{told}");
}
