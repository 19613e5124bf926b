//! `export --scale-from`: the sample's unit is a metre, which its truth knows and the program must find.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::cli::{bad, good, json, text};
use exr::prelude::read_first_flat_layer_from_file;
use glam::DVec3;
use litetex_exporters::{AssetCamera, METRES, ReadLimits, UNKNOWN_SCALE, read_asset};
use std::path::Path;

/// The camera's point on the surface that a pixel shows, in camera axes, by the truth of the sample.
fn truth(capture: &Path, camera: &AssetCamera, [x, y]: [usize; 2]) -> DVec3 {
    let file = capture.join("truth/depth").join(camera.name.replace(".png", ".exr"));
    let depth = read_first_flat_layer_from_file(file).unwrap().layer_data.channel_data.list[0]
        .sample_data
        .values_as_f32()
        .nth(y * camera.width_px as usize + x)
        .unwrap();
    let at = [x as f64 + 0.5, y as f64 + 0.5];
    let slope = |i: usize| (at[i] - camera.principal_px[i]) / camera.focal_px[i];
    DVec3::new(slope(0), slope(1), 1.0) * f64::from(depth)
}

/// Where another camera sees a point of a camera's axes, as a pixel.
fn seen(from: &AssetCamera, by: &AssetCamera, point: DVec3, unit: f64) -> [f64; 2] {
    let rows = |camera: &AssetCamera| camera.rotation_rows.map(DVec3::from);
    let moved = point / unit - DVec3::from(from.translation);
    let [a, b, c] = rows(from);
    let local = a * moved.x + b * moved.y + c * moved.z;
    let p = DVec3::from(rows(by).map(|row| row.dot(local))) + DVec3::from(by.translation);
    std::array::from_fn(|i| by.focal_px[i] * p[i] / p.z + by.principal_px[i] - 0.5)
}

#[test]
fn two_points_make_a_unit_a_metre() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (capture, run) = (at("capture"), at("run"));
    good(&["sample", text(&capture), "--size", "96x64", "--views", "16"]);
    let settings = ["--steps", "200", "--device", "cpu", "--set", "max-points=400"];
    good(&[&["train", text(&capture), "-o", text(&run), "-q"][..], &settings].concat());
    assert_eq!(json(&["inspect", text(&run)])["checkpoint"]["scale"], UNKNOWN_SCALE);
    let first = at("first.ltgs");
    let export = |file: &Path, more: &[&str]| {
        good(
            &[
                &["export", text(&run), "-o", text(file), "--device", "cpu", "--no-verify", "--force"][..],
                more,
            ]
            .concat(),
        );
        read_asset(file, &ReadLimits::default()).unwrap().asset
    };
    // Negative control: no file says metres before a scale is known.
    let asset = export(&first, &[]);
    assert_eq!((asset.provenance.scale.as_str(), asset.world_from_capture.scale), (UNKNOWN_SCALE, 1.0));
    let [a, b] = [3, 6].map(|i: usize| asset.cameras[i].clone());
    let (p, q) = ([30, 40], [60, 44]);
    let [in_p, in_q] = [p, q].map(|pixel| truth(&capture, &a, pixel));
    let metres = in_p.distance(in_q);

    // On the trained surface: coarse, since the run is short. A wrong length is found wrong.
    let one_view = |metres: f64| format!("{0}:30,40 {0}:60,44 = {metres}m", a.name);
    let factor = |from: &str| export(&at("scaled.ltgs"), &["--scale-from", from]).world_from_capture.scale;
    let found = factor(&one_view(metres));
    assert!((found - 1.0).abs() < 0.1, "{found}");
    let doubled = factor(&one_view(2.0 * metres));
    assert!((doubled / found - 2.0).abs() < 1e-9, "{doubled}");

    // In two views: exact, since the sample's poses are.
    let unit = asset.capture_from_local.scale;
    let both = |pixel: [usize; 2], point| {
        let [x, y] = seen(&a, &b, point, unit);
        format!("{}:{},{}+{}:{x},{y}", a.name, pixel[0], pixel[1], b.name)
    };
    let cm = 100.0 * metres;
    let found = factor(&format!("{} {} = {cm}cm", both(p, in_p), both(q, in_q)));
    assert!((found - 1.0).abs() < 1e-4, "{found}");

    // Kept for later exports, in all formats, and said by all.
    for name in ["a.glb", "a.usda", "a.ltgs", "a.html", "a.ply", "a.spz"] {
        let file = at(name);
        let asset = export(&file, &[]);
        assert!(asset.provenance.scale.starts_with(METRES), "{name}: {}", asset.provenance.scale);
        let said = json(&["inspect", text(&file)])["scale"].as_str().unwrap().to_owned();
        assert!(said.starts_with(METRES), "{name}: {said}");
    }
    assert!(std::fs::read_to_string(at("a.usda")).unwrap().contains("metricScale = true"));
    assert!(json(&["inspect", text(&run)])["checkpoint"]["scale"].as_str().unwrap().starts_with(METRES));
    good(&["export", text(&run), "--scale-from", "none"]);
    assert_eq!(export(&first, &[]).provenance.scale, UNKNOWN_SCALE);
    // Places in the capture's frame need no photos, so that assets have a scale too.
    let other = at("other.ltgs");
    let from = "-1,0,0 -1,0,2 = 5m";
    good(&[
        "export",
        text(&first),
        "-o",
        text(&other),
        "--scale-from",
        from,
        "--no-verify",
        "--device",
        "cpu",
    ]);
    assert_eq!(read_asset(&other, &ReadLimits::default()).unwrap().asset.world_from_capture.scale, 2.5);

    let name = &a.name;
    for (from, part) in [
        ("nowhere.png:1,2 nowhere.png:3,4 = 1m".to_owned(), "no view \"nowhere.png\""),
        (format!("{name}:300,4 {name}:3,4 = 1m"), "96 x 64 pixels"),
        (format!("{name}:3,4 {name}:3,4 = 1m"), "same"),
        (format!("{name}:3,4 {name}:5,4 = 0m"), "above 0"),
        (format!("{name}:3,4 {name}:5,4 = 1metre"), "mm, cm, m, in or ft"),
        (format!("{name}:30,40+{name}:30.1,40 {name}:60,44 = 1m"), "nearly parallel"),
        (format!("{name}:30,40+{}:2,3 {name}:60,44 = 1m", b.name), "miss each other"),
        ("0,0,0 1e-320,0,0 = 1m".to_owned(), "same place"),
        ("0,0,0 1e-5,0,0 = 1m".to_owned(), "less than the detail of the scene"),
    ] {
        let (code, message) = bad(&["export", text(&run), "--scale-from", &from]);
        assert!(code == 2 && message.contains(part), "{from}: {message}");
    }
    let (code, message) = bad(&["export", text(&first), "-o", text(&other), "--scale-from", &one_view(1.0)]);
    assert!(code == 2 && message.contains("knows no photos") || message.contains("exists"), "{message}");
}
