//! Layers of `.ltgs` files from the command line: the first ones are a coarser scene, and requests that no file can meet are
//! refused.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::cli::{good, json, litetex, text};
use litetex_exporters::{Quality, WriteOptions, write_asset};
use litetex_gs::Report;
use litetex_gs::bake::{asset_camera, bake};
use litetex_gs::selftest::{SceneOptions, random_scene};
use std::path::{Path, PathBuf};

/// Writes a scene of enough splats for three layers, and the same without layers.
fn files(folder: &Path) -> [PathBuf; 3] {
    let scene = random_scene(&SceneOptions {
        num_splats: 9000,
        sh_degree: 1,
        map_sizes: vec![(0, 0), (2, 2), (0, 0), (3, 1)],
        width_px: 64,
        height_px: 48,
        scales: (0.005, 0.05),
        opacities: (0.1, 0.9),
        depths: (0.8, 2.0),
        ..SceneOptions::default()
    });
    let camera = asset_camera("0.png", false, &scene.camera);
    let asset = bake(&scene.model, vec![camera], [0.2, 0.4, 0.1], Default::default(), &mut Report::default());
    let files =
        [("layered.ltgs", Quality::Tiny), ("whole.ltgs", Quality::Lossless), ("streamed.glb", Quality::Tiny)];
    files.map(|(name, quality)| {
        let path = folder.join(name);
        write_asset(&path, &asset, &WriteOptions { quality, ..WriteOptions::default() }).unwrap();
        path
    })
}

#[test]
fn each_layer_brings_the_scene_closer() {
    let folder = tempfile::tempdir().unwrap();
    let [layered, ..] = files(folder.path());
    let found = json(&["inspect", text(&layered)]);
    let layers = found["layers"].as_object().unwrap();
    let sum = |name: &str| layers.values().map(|layer| layer[name].as_u64().unwrap()).sum::<u64>();
    assert_eq!(layers.len(), 3);
    assert_eq!((found["model"]["splats"].as_u64(), sum("splats")), (Some(9000), 9000));
    assert_eq!(found["model"]["texels"].as_u64(), Some(sum("texels")));
    let others = ["header", "metadata", "contents"].map(|n| found["sections"][n]["bytes"].as_u64().unwrap());
    assert_eq!(found["bytes"].as_u64(), Some(sum("bytes") + others.iter().sum::<u64>()));
    let share = layers["1"]["bytes"].as_f64().unwrap() / found["bytes"].as_f64().unwrap();
    assert!((0.1..0.16).contains(&share), "{share}");
    let mut before = 0.0;
    for layers in ["1", "2", "3"] {
        let part = folder.path().join(format!("{layers}.glb"));
        good(&["convert", text(&layered), text(&part), "--layers", layers, "--quality", "lossless", "-q"]);
        let compared = json(&["compare", text(&part), text(&layered), "--device", "cpu"]);
        // Equal scenes have no finite PSNR.
        let psnr = compared["psnr"].as_f64().unwrap_or(f64::INFINITY);
        assert!(psnr > before + 1.0, "{layers} layers: {psnr} dB after {before}");
        before = psnr;
    }
    assert!(before > 90.0, "all layers: {before} dB");
}

#[test]
fn a_stream_in_gltf_has_the_layers_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let [layered, _, streamed] = files(folder.path());
    let [of_file, of_stream] = [&layered, &streamed].map(|path| json(&["inspect", text(path)]));
    assert_eq!(of_stream["layers"], of_file["layers"]);
    let part = folder.path().join("part.glb");
    good(&["convert", text(&streamed), text(&part), "--layers", "1", "--quality", "lossless", "-q"]);
    assert_eq!(json(&["inspect", text(&part)])["model"]["splats"], of_file["layers"]["1"]["splats"]);
    let images = folder.path().join("images");
    good(&["render", text(&streamed), "--layers", "2", "--view", "0.png", "--out", text(&images)]);
}

#[test]
fn layers_are_rendered_from_a_file_that_is_cut_off_behind_them() {
    let folder = tempfile::tempdir().unwrap();
    let [layered, ..] = files(folder.path());
    let bytes = std::fs::read(&layered).unwrap();
    let found = json(&["inspect", text(&layered)]);
    let later = ["2", "3"].map(|layer| found["layers"][layer]["bytes"].as_u64().unwrap() as usize);
    let cut = folder.path().join("cut.ltgs");
    std::fs::write(&cut, &bytes[..bytes.len() - later.iter().sum::<usize>()]).unwrap();
    let render = |file: &Path, to: &str, more: &[&str]| {
        let out = folder.path().join(to);
        let base = ["render", text(file), "--view", "0.png", "--device", "cpu", "-q", "-o", text(&out)];
        let output = litetex(&[&base, more].concat());
        output.status.success().then(|| std::fs::read(out.join("0.png")).unwrap())
    };
    let first = render(&layered, "a", &["--layers", "1"]).unwrap();
    assert!(render(&cut, "b", &["--layers", "1"]).unwrap() == first);
    // Negative controls: the whole scene looks different; more of the file that is cut off cannot be read.
    assert!(render(&layered, "c", &[]).unwrap() != first);
    assert!(render(&cut, "d", &["--layers", "2"]).is_none() && render(&cut, "e", &[]).is_none());
}

#[test]
fn layers_that_are_not_there_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [layered, whole, _] = files(folder.path());
    let glb = folder.path().join("a.glb");
    good(&["convert", text(&layered), text(&glb), "--layers", "1", "--no-verify", "-q"]);
    for (file, layers, what) in [
        (layered.as_path(), "4", "layered.ltgs has 3 layers"),
        (&whole, "2", "whole.ltgs has one layer"),
        (&glb, "1", "a.glb has no layers, as only .ltgs files and glTF files of quality tiny do"),
        (folder.path(), "1", "is no asset"),
    ] {
        let out = folder.path().join("out");
        let output = litetex(&["render", text(file), "--test", "--layers", layers, "-o", text(&out)]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(&format!("--layers {layers}: ")) && message.contains(what), "{message}");
        assert!(!out.exists());
    }
    let none = litetex(&["convert", text(&layered), text(&folder.path().join("b.glb")), "--layers", "0"]);
    assert_eq!(none.status.code(), Some(2));
}
