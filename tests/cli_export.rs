//! Assets from the command line: every format and quality is written, verified, read back and compared; errors are
//! reported with the exit code of their family.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::cli::{bad, good, json, litetex, text};
use litetex_exporters::{Quality, ReadLimits, WriteOptions, read_asset, write_asset};
use std::path::{Path, PathBuf};
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
            "--set",
            "max-points=400",
            "--export",
            text(&folder.path().join("trained.glb")),
            "--export",
            text(&folder.path().join("trained.ltgs")),
        ]);
        for name in ["trained.glb", "trained.ltgs"] {
            assert!(folder.path().join(name).is_file(), "{name}");
        }
        (folder, run)
    });
    run
}

#[test]
fn lossless_files_of_all_formats_render_without_any_difference() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let files = ["a.glb", "b.gltf", "c.ltgs", "d.usda", "e.usdc", "f.usdz"].map(|f| folder.path().join(f));
    let names: Vec<&str> = files.iter().map(|f| text(f)).collect();
    let message = good(
        &[&["export", text(run), "--quality", "lossless", "--device", "cpu", "-o"], &names[..]].concat(),
    );
    assert_eq!(message.matches(" same ").count(), 6, "{message}");
    assert_eq!(message.matches(" yes").count(), 6, "{message}");
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
    let (code, message) = bad(&["verify", text(&half), "--against", text(run), "--device", "cpu"]);
    assert!(code == 1 && message.contains("no difference"), "{message}");
}

#[test]
fn lossy_files_meet_their_limits_and_plain_formats_keep_colours() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    for (name, quality) in [
        ("a.glb", Some("balanced")),
        ("b.ltgs", Some("balanced")),
        ("c.usdz", Some("balanced")),
        ("d.ltgs", Some("tiny")),
        ("e.ply", None),
        ("f.spz", None),
    ] {
        let file = at(name);
        let export = ["export", text(run), "-o", text(&file), "--device", "cpu"];
        let quality: Vec<&str> = quality.into_iter().flat_map(|q| ["--quality", q]).collect();
        let table = good(&[&export[..], &quality].concat());
        let verdict = json(&["verify", text(&file), "--against", text(run), "--device", "cpu"]);
        assert_eq!(verdict["verified"], true, "{name}: {verdict}");
        let v = &verdict["verdict"];
        let [before, after] = ["before", "after"].map(|k| v["on_test_photos"][k].as_f64().unwrap());
        assert!(before > 10.0, "the capture is there");
        assert!(table.contains(&format!("{before:.2} -> {after:.2} dB")), "{after}: {table}");
        assert_eq!(v["untextured"], ["e.ply", "f.spz"].contains(&name));
        println!("{name} {quality:?}: {} dB, {} dB lost", v["psnr"], v["loss_db"]);
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
    // Bounds one byte below what another bound led to, in whatever quality the files turn out to be.
    let tight = at("tight.ltgs");
    let mut bound = size("small.ltgs");
    for _ in 0..4 {
        bound -= 1;
        let (file, bytes) = (text(&tight), format!("{bound}B"));
        good(&[
            "export",
            text(run),
            "-o",
            file,
            "--max-size",
            &bytes,
            "--device",
            "cpu",
            "--no-verify",
            "--force",
        ]);
        assert!(size("tight.ltgs") <= bound, "{} for {bound}", size("tight.ltgs"));
        bound = size("tight.ltgs");
    }
    // The closed loop's file keeps the same limits, which writing verifies, and is never the larger one.
    let closed = at("closed.ltgs");
    good(&[
        "export",
        text(run),
        "-o",
        text(&closed),
        "--quality",
        "tiny",
        "--effort",
        "3",
        "--device",
        "cpu",
    ]);
    assert!(size("closed.ltgs") <= size("d.ltgs"));
    // More may be lost than any quality allows, if that is what was requested.
    let coarse = at("coarse.ltgs");
    good(&["export", text(run), "-o", text(&coarse), "--max-loss", "1dB", "--device", "cpu"]);
    // Such a file guarantees nothing, and is held to what verify is asked.
    assert_eq!(json(&["inspect", text(&coarse)])["quality"], "custom");
    let verify = ["verify", text(&coarse), "--against", text(run), "--device", "cpu"];
    assert!(good(&verify).contains("this quality has no limits"));
    assert!(good(&[&verify[..], &["--max-loss", "1.2dB"]].concat()).contains("yes"));
    let (code, message) = bad(&[&verify[..], &["--max-loss", "0.1dB"]].concat());
    assert!(code == 1 && message.contains("at most 0.1"), "{message}");
    // Without cameras nothing can be measured.
    let (code, message) = bad(&["convert", text(&at("e.ply")), text(&at("no.ltgs")), "--max-loss", "0.1dB"]);
    assert!(code == 2 && message.contains("no cameras"), "{message}");
    let (code, message) = bad(&["export", text(run), "-o", text(&at("no.glb")), "--max-loss", "1dB"]);
    assert!(code == 2 && message.contains(".ltgs"), "{message}");
    let (code, message) = bad(&["export", text(run), "-o", text(&at("no.ltgs")), "--max-size", "500B"]);
    assert!(code == 2 && message.contains("--max-size") && !at("no.ltgs").exists(), "{message}");
}

#[test]
fn formats_without_textures_tell_what_the_textures_were_good_for() {
    const ADVICE: &str = "litetex train --for engine";
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let (spz, ply, glb) = (at("a.spz"), at("a.ply"), at("a.glb"));
    let export =
        ["export", text(run), "--device", "cpu", "--force", "-o", text(&spz), text(&ply), text(&glb)];
    let files = json(&export)["files"].clone();
    let of = |i: usize, key: &str| files[i]["lost_textures"][key].as_f64().unwrap();
    for i in 0..2 {
        assert_eq!(files[i]["lost_textures"]["train_instead"], ADVICE);
        // The file matches the scene without its textures, not the textured scene.
        let psnr = files[i]["verdict"]["psnr"].as_f64().unwrap();
        assert!(of(i, "psnr_to_textured") < psnr - 3.0, "{psnr}: {}", files[i]);
        assert!(of(i, "loss_db") > 0.05, "{}", files[i]);
        let photos = |key: &str| files[i]["on_test_photos"][key].as_f64().unwrap();
        assert!(photos("before") == files[2]["on_test_photos"]["before"].as_f64().unwrap(), "textured");
        assert!(photos("after") == photos("fallback"));
    }
    assert!(files[2]["lost_textures"].is_null(), "glTF keeps them");
    let table = good(&export);
    for (i, name) in [(0, "a.spz"), (1, "a.ply")] {
        let line = table.lines().find(|line| line.contains(&format!("{name}: "))).unwrap();
        assert!(line.contains(&format!("{:.2} dB against the textured scene", of(i, "psnr_to_textured"))));
        // The figures of the table, and no others.
        let [before, after] =
            ["before", "after"].map(|key| files[i]["on_test_photos"][key].as_f64().unwrap());
        assert!(table.contains(&format!("{before:.2} -> {after:.2} dB")), "{table}");
        let both = format!("; test PSNR {before:.2} dB with the textures, {after:.2} dB without; ");
        assert!(line.contains(&both) && !line.contains("estimated"), "{line}");
        assert!(line.ends_with(ADVICE), "{line}");
    }
    assert!(!table.contains("a.glb: "), "{table}");
    let unverified = json(&[&export[..], &["--no-verify"]].concat());
    assert_eq!(unverified["files"][0]["lost_textures"]["train_instead"], ADVICE);
    assert!(unverified["files"][0]["lost_textures"]["psnr_to_textured"].is_null());
    // An asset alone has no photos.
    let table = good(&["export", text(&glb), "-o", text(&at("alone.ply")), "--device", "cpu"]);
    assert!(table.contains(" dB of test PSNR lost with the textures; "), "{table}");
    // Negative controls: a file that has no textures any more, and a run that never had any; `train --export` says the same.
    let table = good(&["export", text(&spz), "-o", text(&at("again.ply")), "--device", "cpu"]);
    assert!(!table.contains(ADVICE), "{table}");
    let capture = run.parent().unwrap().join("capture");
    for (purpose, says) in [("page", true), ("engine", false)] {
        let (out, file) = (at(purpose), at(&format!("{purpose}.spz")));
        let train = ["train", text(&capture), "-o", text(&out), "--for", purpose, "--export", text(&file)];
        let short = [
            "--steps",
            "60",
            "--device",
            "cpu",
            "--set",
            "max-points=200",
            "--set",
            "density.texture-start=1",
        ];
        let table = good(&[&train[..], &short].concat());
        assert_eq!(table.contains(ADVICE), says, "{purpose}: {table}");
        assert_eq!(table.contains("* against the untextured scene"), says, "{purpose}: {table}");
        let row = table.lines().find(|line| line.trim_start().contains("engine.spz ")).unwrap_or_default();
        assert!(says || row.matches(" dB").count() == 3 && !row.contains("textures"), "{table}");
    }
    let config = std::fs::read_to_string(at("engine").join("config.toml")).unwrap();
    for setting in ["policy = \"plain\"", "sh-below = 0.0", "filter = \"ewa\"", "max-splats = "] {
        assert!(config.contains(setting), "{setting}: {config}");
    }
}

#[test]
fn every_file_is_listed_with_its_own_size() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let table =
        good(&["export", text(run), "-o", text(&at("a.glb")), text(&at("b.gltf")), "--mesh", "--no-verify"]);
    let row = |name: &str| -> Vec<String> {
        let named = |line: &&str| line.trim_start().starts_with(text(&at(name)));
        table.lines().find(named).expect(&table).split_whitespace().map(ToOwned::to_owned).collect()
    };
    let bytes = |name: &str| std::fs::metadata(at(name)).unwrap().len() as f64;
    for name in ["a.glb", "a.mesh.glb", "b.gltf", "b.bin", "b.mesh.glb"] {
        let unit = match row(name)[2].as_str() {
            "B" => 1.0,
            "KiB" => 1024.0,
            "MiB" => 1_048_576.0,
            other => panic!("{other}: {table}"),
        };
        let shown = row(name)[1].parse::<f64>().unwrap() * unit;
        // One digit behind the point.
        assert!(
            (shown - bytes(name)).abs() <= 0.05 * unit + 0.5,
            "{name}: {shown}, is {}: {table}",
            bytes(name)
        );
        // Negative control: the sum of two files, as one size.
        assert!(bytes(name) + bytes("a.glb") - shown > unit);
        assert_eq!(
            row(name)[3] == "-",
            !["a.glb", "b.gltf"].contains(&name),
            "ratios are those of scenes: {table}"
        );
    }
}

#[test]
fn spz_files_take_the_version_the_bits_and_the_cameras_asked_for() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let export = |name: &str, options: &[&str]| {
        good(&[&["export", text(run), "-o", text(&at(name)), "--device", "cpu"], options].concat());
        (json(&["inspect", text(&at(name))]), std::fs::metadata(at(name)).unwrap().len())
    };
    let (tiny, tiny_bytes) = export("tiny.spz", &["--quality", "tiny"]);
    let (balanced, balanced_bytes) = export("balanced.spz", &[]);
    let (finest, finest_bytes) = export("finest.spz", &["--quality", "lossless"]);
    assert!(
        tiny_bytes < balanced_bytes && balanced_bytes < finest_bytes,
        "{tiny_bytes} {balanced_bytes} {finest_bytes}"
    );
    for found in [&tiny, &balanced, &finest] {
        assert_eq!((&found["format"], &found["cameras"]), (&"SPZ 3".into(), &0.into()));
        assert!(found["sections"]["metadata"]["bytes"].as_u64().unwrap() < 700, "{found}");
    }
    let (newer, _) = export("newer.spz", &["--spz-version", "4", "--cameras", "all"]);
    assert_eq!((&newer["format"], &newer["cameras"]), (&"SPZ 4".into(), &16.into()));
    let psnr = |name: &str| {
        let verdict = json(&["verify", text(&at(name)), "--against", text(run), "--device", "cpu"]);
        verdict["verdict"]["psnr"].as_f64().unwrap()
    };
    let psnrs = ["tiny.spz", "balanced.spz", "finest.spz"].map(psnr);
    println!("{psnrs:.2?} dB");
    assert!(psnrs[0] <= psnrs[1] && psnrs[1] <= psnrs[2]);
    let (code, message) = bad(&["export", text(run), "-o", text(&at("no.spz")), "--spz-version", "2"]);
    assert!(code == 2 && message.contains("from 3 to 4") && !at("no.spz").exists(), "{message}");
}

#[test]
fn a_program_chooses_what_is_up_in_ply_files_alone() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    for (name, up) in [("a", "three"), ("b", ":y"), ("c", "splat-transform")] {
        let [ply, glb] = ["ply", "glb"].map(|extension| at(&format!("{name}.{extension}")));
        good(&["export", text(run), "-o", text(&ply), text(&glb), "--up", up, "--device", "cpu"]);
    }
    let read = |name: &str| std::fs::read(at(name)).unwrap();
    assert!(read("a.ply") == read("b.ply") && read("a.ply") != read("c.ply"));
    assert!(read("a.glb") == read("b.glb") && read("a.glb") == read("c.glb"), "glTF says what is up");
    // Files made of it are as those made of the run.
    good(&["convert", text(&at("a.ply")), text(&at("back.ply")), "--no-verify"]);
    let rows = |name: &str| {
        let bytes = read(name);
        let end = b"end_header\n";
        let header = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let numbers = bytes[header..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()));
        numbers.collect::<Vec<_>>()
    };
    let largest =
        |a: &str, b: &str| rows(a).iter().zip(rows(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(largest("back.ply", "c.ply") < 1e-4, "{}", largest("back.ply", "c.ply")); // f32 twice
    assert!(largest("a.ply", "c.ply") > 0.1, "negative control");
}

#[test]
fn scenes_without_cameras_are_verified_from_around_them() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    good(&["export", text(run), "-o", text(&at("bare.ply")), "--device", "cpu"]);
    let bare = json(&["inspect", text(&at("bare.ply"))]);
    assert!(bare["cameras"].as_array().is_none_or(Vec::is_empty) && bare["layers_per_pixel"].is_null());
    let made = good(&["convert", text(&at("bare.ply")), "-o", text(&at("a.glb")), "--device", "cpu"]);
    assert!(made.contains(" yes"), "{made}");
    let bare = at("bare.ply");
    let against = ["--against", text(&bare), "--device", "cpu"];
    let verdict = json(&[&["verify", text(&at("a.glb"))], &against[..]].concat());
    assert_eq!(verdict["verdict"]["views"], 8, "{verdict}");
    // Negative control: with splats left out, it is another scene.
    good(&[
        "convert",
        text(&at("bare.ply")),
        "-o",
        text(&at("b.glb")),
        "--crop",
        "-1e9,-1e9,-1e9:0,1e9,1e9",
        "--no-verify",
    ]);
    let (code, message) = bad(&[&["verify", text(&at("b.glb"))], &against[..]].concat());
    assert_eq!(code, 1, "{message}");
}

#[test]
fn scenes_are_cropped_reoriented_and_titled() {
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
    let count = |v: &serde_json::Value| v["splats"].as_u64().unwrap();
    assert!(count(&found["model"]) > 0 && count(&found["model"]) < count(&whole));
    assert_eq!(
        (&found["provenance"]["author"], &found["provenance"]["title"]),
        (&"Ann".into(), &"Half".into())
    );
    let bound = |frame: &str, side: &str, axis: usize| found["model"][frame][side][axis].as_f64().unwrap();
    assert!(bound("bounds_in_capture", "min", 0) >= middle(0) - 1e-6);
    // x stays, doubled; z is where -y was, y is where z was.
    for (world, capture, sign) in [(0, 0, 1.0), (1, 2, -1.0), (2, 1, 1.0)] {
        let sides = if sign > 0.0 { ["min", "max"] } else { ["max", "min"] };
        for (side, of_capture) in ["min", "max"].into_iter().zip(sides) {
            let expected = 2.0 * sign * bound("bounds_in_capture", of_capture, capture);
            let found = bound("bounds_in_world", side, world);
            assert!((found - expected).abs() < 1e-6, "{world} {side}: {found} {expected}");
        }
    }
    // What was cut is not the scene, and verify says why.
    let (code, message) = bad(&["verify", text(&file), "--against", text(run), "--device", "cpu"]);
    assert!(code == 1 && message.contains("verify a cropped file"), "{message}");
}

#[test]
fn reoriented_and_rescaled_files_verify_against_the_scene() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    for name in ["a.glb", "a.ltgs", "a.usda", "a.ply", "a.spz"] {
        let file = at(name);
        good(&["export", text(run), "-o", text(&file), "--up", "z", "--scale", "0.5", "--device", "cpu"]);
        good(&["verify", text(&file), "--against", text(run), "--device", "cpu"]);
        // The same edit again changes nothing, and boxes are those of the capture.
        let bounds = |path: &Path| json(&["inspect", text(path)])["model"]["bounds_in_world"].clone();
        let again = at(&format!("again_{name}"));
        let everything = "-1e6,-1e6,-1e6:1e6,1e6,1e6";
        good(&["convert", text(&file), text(&again), "--up", "z", "--crop", everything, "--no-verify"]);
        let numbers = |v: &serde_json::Value| -> Vec<f64> {
            let of = |side: &str| {
                v[side].as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect::<Vec<_>>()
            };
            [of("min"), of("max")].concat()
        };
        let (before, after) = (numbers(&bounds(&file)), numbers(&bounds(&again)));
        let worst = before.iter().zip(&after).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 0.01, "{name}: {before:?} {after:?}"); // steps of lossy files
    }
}

#[test]
fn existing_files_are_replaced_only_by_verified_ones() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let glb = at("a.glb");
    good(&["export", text(run), "-o", text(&glb), "--quality", "lossless", "--device", "cpu"]);
    // Pages and arrays of others are no less theirs than the file that is named.
    std::fs::write(at("b.bin"), "mine").unwrap();
    let (code, message) = bad(&["convert", text(&glb), text(&at("b.gltf"))]);
    assert!(code == 2 && message.contains("b.bin") && message.contains("--force"), "{message}");
    // The first file is written, the second is not right and leaves the old one alone; both are message.
    std::fs::write(at("c.spz"), "old").unwrap();
    let output = litetex(&[
        "export",
        text(&glb),
        "-o",
        text(&at("c.glb")),
        text(&at("c.spz")),
        "--scale",
        "1e-6",
        "--force",
        "--device",
        "cpu",
    ]);
    let message = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.lines().any(|l| l.contains("c.glb") && l.ends_with("yes")), "{message}");
    assert!(message.lines().any(|l| l.contains("c.spz") && l.ends_with("NO")), "{message}");
    assert_eq!(std::fs::read(at("c.spz")).unwrap(), b"old");
    assert!(at("c.glb").is_file());
    // One that cannot be put in place does not take the others' rows away.
    std::fs::create_dir(at("d_usda_textures")).unwrap();
    std::fs::create_dir(at("d_usda_textures/page0.png")).unwrap();
    let output = litetex(&[
        "export",
        text(&glb),
        "-o",
        text(&at("d.ply")),
        text(&at("d.usda")),
        "--force",
        "--device",
        "cpu",
    ]);
    let message = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(!output.status.success() && message.contains("d.ply") && at("d.ply").is_file(), "{message}");
    assert!(!at("d.usda").exists());
    let hidden = std::fs::read_dir(folder.path())
        .unwrap()
        .filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
    assert_eq!(hidden.count(), 0, "nothing temporary stays");
}

#[test]
fn progress_knows_about_how_many_views_are_rendered() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    for (name, options) in [
        ("a.ltgs", &["--quality", "tiny"][..]),
        ("b.ltgs", &["--quality", "tiny", "--effort", "2"]),
        ("c.ltgs", &["--max-size", "30kB", "--no-verify"]),
        ("f.ltgs", &["--max-loss", "0.3dB"]),
        ("d.glb", &["--quality", "tiny"]),
        ("e.usdz", &[]),
    ] {
        let file = folder.path().join(name);
        let output =
            litetex(&[&["export", text(run), "-o", text(&file), "--device", "cpu", "-v"], options].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        let line = message.lines().find(|line| line.contains("views rendered")).expect(&message);
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        println!("{name}: {numbers:?}");
        assert!((0.7..1.4).contains(&(numbers[0] / numbers[1])), "{name}: {line}");
    }
}

#[test]
fn impossible_exports_are_refused_before_writing() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let cases: [(&[&str], i32, &str); 10] = [
        (&["-o", "x.obj"], 4, "expected an asset (.glb"),
        (&["-o", "x.usdz", "--quality", "tiny"], 4, "lossless and balanced"),
        (&["-o", "x.ltgs", "./x.ltgs"], 2, "as well"),
        (&["-o", "x.ltgs", "--mesh"], 2, "--mesh"),
        (&["-o", "x.ltgs", "--min-contribution", "NaN"], 2, "pixels"),
        (&["-o", "x.ltgs", "--up", "w"], 2, "--up"),
        (&["-o", "x.ltgs", "--crop", "9e8,9e8,9e8:1e9,1e9,1e9"], 2, "leave no splat"),
        (&["-o", "x.ltgs", "--quality", "lossless", "--max-size", "1MB"], 2, "--max-size"),
        (&["-o", "x.ltgs", "--effort", "0"], 2, "--effort"),
        (&["-o", "x.ltgs", "--device", "no-such"], 4, "no-such"),
    ];
    for (args, code, word) in cases {
        let args: Vec<String> = args
            .iter()
            .map(|a| if a.contains("x.") { format!("{}/{a}", text(folder.path())) } else { (*a).to_owned() })
            .collect();
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        let (found, message) = bad(&[&["export", text(run)], &args[..]].concat());
        assert!(found == code && message.contains(word), "{args:?}: {found} {message}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was left behind");
    let file = at("a.ply");
    std::fs::write(&file, "mine").unwrap();
    let (code, message) = bad(&["export", text(run), "-o", text(&file)]);
    assert!(code == 2 && message.contains("--force"), "{message}");
    assert_eq!(std::fs::read(&file).unwrap(), b"mine");
    let (code, message) = bad(&["verify", text(&file), "--against", text(run)]);
    assert!(code == 3 && message.contains("a.ply"), "{message}");
    let (code, message) = bad(&["validate", text(&file)]);
    assert!(code == 1 && message.trim_end().ends_with("a.ply: breaks 1 rule"), "{message}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_export_leaves_nothing_behind() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let names = || -> Vec<String> {
        let entries = std::fs::read_dir(folder.path()).unwrap();
        entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect()
    };
    let old = folder.path().join("a.usda");
    std::fs::write(&old, "old").unwrap();
    // Again where the export was over before the signal came.
    for attempt in 0..20 {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_litetex"))
            .args(["export", text(run), "-o", text(&old), "--force", "--device", "cpu", "-q"])
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        while !names().iter().any(|n| n.ends_with(".part")) && child.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        let code = child.wait().unwrap().code();
        assert!(!names().iter().any(|n| n.starts_with('.')), "{:?}", names());
        if code == Some(130) {
            assert_eq!(std::fs::read(&old).unwrap(), b"old");
            return;
        }
        println!("attempt {attempt}: {code:?}");
        std::fs::remove_dir_all(folder.path().join("a_usda_textures")).unwrap();
        std::fs::write(&old, "old").unwrap();
    }
    panic!("never in time");
}

/// Overwrites an attribute of the only primitive of a `.glb` with a number.
fn falsify(glb: &Path, attribute: &str, number: f32) {
    let mut bytes = std::fs::read(glb).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let json_bytes = word(12);
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + json_bytes]).unwrap();
    let index = json["meshes"][0]["primitives"][0]["attributes"][attribute].as_u64().unwrap() as usize;
    let accessor = &json["accessors"][index];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let first = |v: &serde_json::Value| v["byteOffset"].as_u64().unwrap_or(0) as usize;
    let start = 28 + json_bytes + first(view) + first(accessor);
    let count = 3 * accessor["count"].as_u64().unwrap() as usize;
    for value in bytes[start..start + 4 * count].as_chunks_mut::<4>().0 {
        *value = number.to_le_bytes();
    }
    std::fs::write(glb, bytes).unwrap();
}

#[test]
fn the_fallback_is_checked_as_stored_in_the_file() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let glb = folder.path().join("a.glb");
    let verify = ["verify", text(&glb), "--against", text(run), "--device", "cpu"];
    for quality in ["lossless", "balanced", "tiny"] {
        let export =
            ["export", text(run), "-o", text(&glb), "--quality", quality, "--force", "--device", "cpu"];
        good(&export);
        let verdict = json(&verify)["verdict"].clone();
        println!("{quality}: {} dB", verdict["fallback_psnr_to_untextured"]);
        assert!(verdict["fallback_psnr_to_untextured"].as_f64().unwrap() > 55.0, "{verdict}");
        // All that our own reader draws is untouched.
        falsify(&glb, "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", 5.0);
        let (code, message) = bad(&verify);
        assert!(code == 1 && message.contains("the fallback differs from the untextured file"), "{message}");
        let (code, message) = bad(&["validate", text(&glb)]);
        assert!(code == 1, "{message}");
    }
}

#[test]
fn images_folders_and_scenes_are_compared() {
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
    let images: Vec<PathBuf> = std::fs::read_dir(at("run")).unwrap().map(|e| e.unwrap().path()).collect();
    let (code, message) = bad(&["compare", text(&images[0]), text(&images[1]), "--min-psnr", "60dB"]);
    assert!(code == 1 && message.contains("60"), "{message}");
    let (code, _) = bad(&["compare", text(&images[0]), text(&glb)]);
    assert_eq!(code, 2);
    let (code, message) = bad(&["compare", text(&at("run")), text(folder.path())]);
    assert!(code == 2 && message.contains("shares a name"), "{message}");
}

#[test]
fn names_from_files_cannot_inject_escape_codes() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let glb = folder.path().join("a.glb");
    let title = "red \u{1b}[31m bell \u{7} line\nforged: row \u{202e}";
    good(&["export", text(run), "-o", text(&glb), "--title", title, "--no-verify", "-q"]);
    let table = good(&["inspect", text(&glb)]);
    assert!(table.contains("red \\u{1b}[31m bell \\u{7} line\\nforged: row \\u{202e}"), "{table}");
    assert!(!table.contains(['\u{1b}', '\u{7}', '\u{202e}']) && !table.contains("\nforged"), "{table}");
    assert_eq!(json(&["inspect", text(&glb)])["provenance"]["title"], title);
    let missing = folder.path().join("b\u{1b}[2J.glb");
    let (code, message) = bad(&["validate", text(&missing)]);
    assert!(code == 3 && message.contains("b\\u{1b}[2J.glb") && !message.contains('\u{1b}'), "{message}");
    // A title of a megabyte does not fill the screen.
    let long = "x".repeat(100_000);
    good(&["export", text(run), "-o", text(&glb), "--title", &long, "--no-verify", "-q", "--force"]);
    assert!(good(&["inspect", text(&glb)]).len() < 10_000);
    let (code, message) = bad(&["render", text(&glb), "--view", &long, "-o", text(folder.path())]);
    assert!(code == 2 && message.len() < 1_000, "{message}");
}

#[test]
fn quality_is_refused_or_reported_as_ignored_where_it_does_not_apply() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let export = ["export", text(run), "--quality", "lossless", "--no-verify", "-q", "-o"];
    let (code, message) = bad(&[&export[..], &[text(&at("a.ply"))]].concat());
    assert!(code == 2 && message.contains("--quality") && !at("a.ply").exists(), "{message}");
    let (code, message) = bad(&[&export[..], &[text(&at("a.glb")), text(&at("a.ply"))]].concat());
    assert!(
        code == 0
            && message.contains("a.ply: this format has a single quality")
            && !message.contains("a.glb"),
        "{message}"
    );
}

#[test]
fn files_to_write_are_given_with_the_flag_or_behind_the_source() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    good(&["export", text(run), "-o", text(&at("a.glb")), "--no-verify"]);
    good(&["convert", text(&at("a.glb")), "-o", text(&at("b.ply")), "--no-verify"]);
    good(&["convert", text(&at("a.glb")), text(&at("c.ply")), "--no-verify"]);
    assert_eq!(std::fs::read(at("b.ply")).unwrap(), std::fs::read(at("c.ply")).unwrap());
    let (code, message) = bad(&["convert", text(&at("a.glb"))]);
    assert!(code == 2 && message.contains("<FILE>"), "{message}");
}

#[test]
fn georeferenced_scenes_are_moved_to_the_origin_where_files_cannot_hold_them() {
    let (run, folder) = (run_folder(), tempfile::tempdir().unwrap());
    let at = |name: &str| folder.path().join(name);
    let (near, far) = (at("near.glb"), at("far.glb"));
    good(&["export", text(run), "-o", text(&near), "--quality", "lossless", "--no-verify"]);
    let mut scene = read_asset(&near, &ReadLimits::default()).unwrap().asset;
    let place = [512_345.5, 4_512_345.25, 101.0];
    scene.capture_from_local.translation =
        std::array::from_fn(|i| scene.capture_from_local.translation[i] + place[i]);
    let options = WriteOptions { quality: Quality::Lossless, ..WriteOptions::default() };
    write_asset(&far, &scene, &options).unwrap();
    let export = |source: &Path, name: &str, more: &[&str]| {
        litetex(
            &[&["export", text(source), "-o", text(&at(name)), "--force", "--device", "cpu"], more].concat(),
        )
    };
    let message = |output: &std::process::Output| String::from_utf8_lossy(&output.stderr).into_owned();
    for (name, code, words) in [
        ("a.ply", 1, "f32 cannot hold coordinates of up to 4.512e6 units"),
        ("a.spz", 3, "SPZ holds coordinates up to 524,287 units; these reach 4.512e6"),
    ] {
        let output = export(&far, name, &[]);
        let said = message(&output);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert!(said.contains(words) && said.contains("--origin auto") && said.contains(name), "{said}");
        assert!(!at(name).exists());
        for origin in ["auto", "512345,4512345,101"] {
            let output = export(&far, name, &["--origin", origin]);
            assert!(
                output.status.success() && !message(&output).contains("cannot hold"),
                "{}",
                message(&output)
            );
            let verdict = json(&["verify", text(&at(name)), "--against", text(&far), "--device", "cpu"]);
            assert_eq!(verdict["verified"], true, "{verdict}");
        }
        // Other coordinates lie elsewhere: verification finds it.
        let (code, said) = bad(&["verify", text(&at(name)), "--against", text(&near), "--device", "cpu"]);
        assert_eq!(code, 1, "negative control: {said}");
        // Reading undoes it, and the next file is where the capture was.
        let back = at("back.glb");
        good(&["convert", text(&at(name)), text(&back), "--origin", "0,0,0", "--no-verify", "--force"]);
        let bounds = &json(&["inspect", text(&back)])["model"]["bounds_in_capture"];
        for (axis, expected) in place.iter().enumerate() {
            let found = bounds["min"][axis].as_f64().unwrap();
            assert!((found - expected).abs() < 100.0, "{axis}: {bounds}");
        }
    }
    let ply = std::fs::read(at("a.ply")).unwrap();
    assert!(ply.windows(34).any(|w| w == b"comment origin: 512345 4512345 101"), "in the header");
    // The other formats hold it as it is.
    for name in ["b.glb", "b.usda", "b.ltgs", "b.html"] {
        let output = export(&far, name, &["--quality", "lossless"]);
        assert!(output.status.success() && !message(&output).contains("origin"), "{}", message(&output));
        let verdict = json(&["verify", text(&at(name)), "--against", text(&far), "--device", "cpu"]);
        assert_eq!(verdict["verdict"]["largest"], 0.0, "{name}: {verdict}");
    }
    assert!(!message(&export(&near, "near.ply", &[])).contains("origin"), "negative control");
}

#[test]
fn splats_of_other_programs_lose_the_broken_ones_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let file = |name: &str, num_broken: u16| {
        let path = folder.path().join(name);
        let mut bytes =
            format!("ply\nformat binary_little_endian 1.0\nelement vertex 200\n{properties}end_header\n")
                .into_bytes();
        for i in 0..200_u16 {
            let x = if (7..7 + num_broken).contains(&i) { f32::NAN } else { f32::from(i) };
            let row = [x, 0.0, 0.0, 0.1, 0.2, 0.3, 2.0, -3.0, -3.0, -9.0, 1.0, 0.0, 0.0, 0.0];
            bytes.extend(row.iter().flat_map(|v: &f32| v.to_le_bytes()));
        }
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let glb = folder.path().join("out.glb");
    let convert =
        |source: &Path| litetex(&["convert", text(source), text(&glb), "--force", "--device", "cpu"]);
    for (num_broken, words) in [
        (1, Some("1 of 200 splats is broken and left out: splat 7: position [NaN, 0.0, 0.0] is not finite")),
        (20, Some("20 of 200 splats are broken and left out: 7, 8, 9, 10, 11 and 15 more; splat 7")),
        (0, None),
    ] {
        let output = convert(&file("some.ply", num_broken));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        assert_eq!(words.is_some_and(|words| said.contains(words)), words.is_some(), "{said}");
        assert_eq!(said.contains("broken"), num_broken > 0, "{said}");
        assert_eq!(json(&["inspect", text(&glb)])["model"]["splats"], 200 - num_broken);
    }
    let output = convert(&file("many.ply", 21));
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(
        said.contains("21 of 200 splats are broken, more than 10 %") && said.contains("many.ply"),
        "{said}"
    );
}
