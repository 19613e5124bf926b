//! `litetex render`: splats coloured by their maps, on every installed backend; assets from a capture's cameras.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

mod common;

use assert_cmd::Command;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Standard output of a command that must pass.
fn ok(arguments: &[&str]) -> String {
    let output = Command::cargo_bin("litetex").unwrap().args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// `cpu` and the software drivers.
fn devices() -> Vec<String> {
    #[cfg(feature = "gpu")]
    let others = common::gpu::drivers().into_iter().map(|driver| driver.name);
    #[cfg(not(feature = "gpu"))]
    let others = std::iter::empty();
    std::iter::once("cpu".to_owned()).chain(others).collect()
}

fn pixels(path: &Path) -> Vec<u8> {
    image::open(path).unwrap().to_rgb8().into_raw()
}

/// Rows of the printed table: label, colour, splats, texels.
fn classes(table: &str) -> Vec<(String, String, usize, usize)> {
    let row = |line: &str| {
        let (label, rest) = line.split_once(" #")?;
        let mut cells = rest.split(", ");
        let colour = cells.next()?.to_owned();
        let mut number = || cells.next()?.trim().replace(',', "").parse().ok();
        Some((label.trim().to_owned(), colour, number()?, number()?))
    };
    table.lines().filter_map(row).collect()
}

#[test]
fn splats_are_coloured_by_their_maps_on_every_device() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (capture, run) = (path("capture"), path("run"));
    ok(&["sample", &capture, "--views", "9", "--size", "64x48", "--points", "300", "--no-truth", "-q"]);
    ok(&["train", &capture, "-o", &run, "--device", "cpu", "--steps", "120", "-q"]);
    let summary: Value =
        serde_json::from_slice(&std::fs::read(Path::new(&run).join("summary.json")).unwrap()).unwrap();
    let names = ["view_0000", "view_0008"];
    let folder = |name: &str| PathBuf::from(path(name));
    ok(&["render", &run, "--test", "-o", &path("plain"), "--device", "cpu", "-q"]);
    let mut first: Option<Vec<Vec<u8>>> = None;
    for device in devices() {
        let out = path(&device);
        let table =
            ok(&["render", &run, "--test", "-o", &out, "--colour-by", "texels", "--device", &device, "-q"]);
        let classes = classes(&table);
        // The counts are those of the summary.
        let sides: Vec<usize> = classes.iter().map(|c| c.2).collect();
        assert_eq!(serde_json::json!(sides), summary["map_sides"], "{table}");
        assert!(sides.iter().filter(|&&n| n > 0).count() > 1, "maps of one size tell nothing: {table}");
        assert_eq!(classes.iter().map(|c| c.3 as u64).sum::<u64>(), summary["size"]["texels"], "{table}");
        assert!(folder(&device).join("texels.legend.png").is_file());
        let images: Vec<Vec<u8>> =
            names.iter().map(|name| pixels(&folder(&device).join(format!("{name}.texels.png")))).collect();
        match &first {
            None => first = Some(images),
            Some(first) => {
                let off = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                let worst = first.iter().zip(&images).map(|(a, b)| off(a, b)).max().unwrap();
                println!("{device}: {worst} of 255 from cpu");
                // A pixel at the edge of a support may flip by 1/255 of a colour, and rounding by another.
                assert!(worst <= 3, "{device}: {worst}");
                // Negative control: the scene as it looks.
                let plain = pixels(&folder("plain").join("view_0000.png"));
                assert!(off(&plain, &images[0]) > 60);
            }
        }
    }
    // Counts are those of the images rendered; larger supports have more.
    let layers = |which: &[&str]| {
        let out = path("counted");
        let arguments = ["render", &run, "-o", &out, "--device", "cpu", "--force", "--stats", "--json", "-q"];
        let found: Value = serde_json::from_str(&ok(&[&arguments[..], which].concat())).unwrap();
        found["layers_per_pixel"].clone()
    };
    let [tests, small] = [&["--test"][..], &["--test", "--size", "16"]].map(layers);
    let of = |layers: &Value, name: &str| layers[name].as_f64().unwrap();
    assert_eq!([&tests["longer_side_px"], &small["longer_side_px"], &tests["views"]], [64, 16, 2]);
    assert!(of(&tests, "rasterised") > of(&tests, "blended") && of(&tests, "blended") > 0.5, "{tests}");
    assert!(tests["rasterised"] != small["rasterised"], "the filter widens splats of small images");
    let sizes = classes(&ok(&[
        "render",
        &run,
        "--view",
        "view_0000.png",
        "-o",
        &path("sizes"),
        "--colour-by",
        "texel-size",
        "--device",
        "cpu",
    ]));
    assert_eq!(sizes.iter().map(|c| c.2 as u64).sum::<u64>(), summary["size"]["splats"]);
    // No texel is finer than two pixels of the nearest camera.
    let finest = sizes.iter().find(|c| c.0 != "none" && c.2 > 0).unwrap();
    assert!(finest.0.trim_end_matches('+').parse::<u32>().unwrap() >= 2, "{sizes:?}");
    ok(&[
        "render",
        &run,
        "--orbit",
        "1",
        "-o",
        &path("own"),
        "--colour-by",
        "splats",
        "--device",
        "cpu",
        "-q",
    ]);
    // Depth has no colours to tell anything with; next to the coloured image it is welcome.
    let depth = |what: &str| {
        let out = path("depth");
        let arguments = ["render", &run, "--orbit", "1", "-o", &out, "--colour-by", "texels", "--what", what];
        Command::cargo_bin("litetex").unwrap().args(arguments).args(["--device", "cpu"]).output().unwrap()
    };
    let refused = depth("depth,alpha");
    let stderr = String::from_utf8(refused.stderr).unwrap();
    assert!(refused.status.code() == Some(2) && stderr.contains("--what"), "{stderr}");
    assert!(!folder("depth").exists());
    assert!(depth("depth,colour").status.success());
    for name in ["orbit-0000.depth.png", "orbit-0000.texels.png", "texels.legend.png"] {
        assert!(folder("depth").join(name).is_file(), "{name}");
    }
    assert!(folder("own").join("orbit-0000.splats.png").is_file());
    assert!(!folder("own").join("splats.legend.png").exists(), "these colours mean nothing");
}

#[test]
fn an_asset_is_rendered_from_its_captures_cameras() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (capture, run) = (path("capture"), path("run"));
    ok(&["sample", &capture, "--views", "9", "--size", "64x48", "--points", "300", "--no-truth", "-q"]);
    // PLY knows no filter.
    let settings = ["--policy", "plain", "--set", "filter=none", "--steps", "40", "--device", "cpu", "-q"];
    ok(&[&["train", &capture, "-o", &run][..], &settings].concat());
    ok(&["render", &run, "--test", "-o", &path("run-seen"), "--device", "cpu", "-q"]);
    // The home view, as pages open.
    let (glb, poster) = (path("scene.glb"), path("poster"));
    ok(&["export", &run, "-o", &glb, "--no-verify", "-q"]);
    ok(&["render", &glb, "--poster", "--size", "32", "-o", &poster, "--device", "cpu", "-q"]);
    let jpeg = image::open(Path::new(&poster).join("poster.jpg")).unwrap().to_rgb8();
    assert!(jpeg.dimensions() == (32, 24) && jpeg.iter().any(|&v| v > 60));
    // PLY knows neither frame nor cameras; its splats stand in the capture's frame, cameras in one of the loader.
    let ply = path("scene.ply");
    ok(&["export", &run, "-o", &ply, "--no-verify", "-q"]);
    let nowhere = ["render", &ply, "--poster", "-o", &poster, "--force", "-q"];
    let refused = Command::cargo_bin("litetex").unwrap().args(nowhere).output().unwrap();
    let stderr = String::from_utf8(refused.stderr).unwrap();
    assert!(refused.status.code() == Some(2) && stderr.contains("no home view"), "{stderr}");
    let seen = path("ply-seen");
    ok(&["render", &ply, "--capture", &capture, "--test", "-o", &seen, "--device", "cpu", "-q"]);
    for name in ["view_0000.png", "view_0008.png"] {
        let of = |folder: &str| pixels(&Path::new(folder).join(name));
        let (expected, found) = (of(&path("run-seen")), of(&seen));
        let largest = expected.iter().zip(&found).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(largest <= 2, "{name}: {largest}"); // needed 0
        assert!(expected.iter().any(|&v| v > 60), "{name} shows nothing");
    }
}

#[test]
fn photos_of_the_same_name_are_not_replaced_without_force() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (capture, run, images) = (path("capture"), path("run"), path("capture/images"));
    ok(&["sample", &capture, "--views", "9", "--size", "64x48", "--points", "300", "--no-truth", "-q"]);
    ok(&["train", &capture, "-o", &run, "--device", "cpu", "--steps", "2", "-q"]);
    let photo = Path::new(&images).join("view_0008.png");
    let before = std::fs::read(&photo).unwrap();
    let count = || std::fs::read_dir(&images).unwrap().count();
    let files = count();
    let render = ["render", &run, "--test", "-o", &images, "--device", "cpu", "-q"];
    let output = Command::cargo_bin("litetex").unwrap().args(render).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("view_0000.png") && stderr.contains("1 more") && stderr.contains("--force"),
        "{stderr}"
    );
    assert!(std::fs::read(&photo).unwrap() == before);
    // Depths have names of their own, legends too.
    ok(&[&render[..], &["--what", "depth"]].concat());
    assert_eq!(count(), files + 2);
    let legend = path("legend");
    let coloured =
        ["render", &run, "--orbit", "1", "-o", &legend, "--colour-by", "texels", "--device", "cpu", "-q"];
    std::fs::create_dir(&legend).unwrap();
    std::fs::write(Path::new(&legend).join("texels.legend.png"), "mine").unwrap();
    let output = Command::cargo_bin("litetex").unwrap().args(coloured).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    ok(&[&render[..], &["--force"]].concat());
    assert!(std::fs::read(&photo).unwrap() != before);
    // Whatever is no file stays, even with --force.
    #[cfg(unix)]
    {
        std::fs::remove_file(&photo).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&photo).status().unwrap().success());
        let forced = [&render[..], &["--force"]].concat();
        let output = Command::cargo_bin("litetex").unwrap().args(forced).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && stderr.contains("a device or a pipe"), "{stderr}");
        assert!(!std::fs::symlink_metadata(&photo).unwrap().is_file());
    }
}
