//! The files of `samples/conformance` render to the pixels that the second renderer, written from the specifications,
//! computed for them.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::assets::images;
use litetex_exporters::{ReadLimits, SplatAsset, read_asset};
use litetex_gs::cpu::CpuBackend;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/conformance")
}

fn read(name: &str) -> SplatAsset {
    let contents = read_asset(&folder().join(name), &ReadLimits::default()).unwrap();
    assert!(contents.warnings.is_empty(), "{:?}", contents.warnings);
    assert_eq!(contents.hash, Some(contents.asset.hash()), "{name}");
    contents.asset
}

/// Largest difference between an asset's images and the expected pixels.
fn max_error(asset: &SplatAsset, expected: &Value) -> f64 {
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    let mut max = 0.0_f64;
    for camera in &asset.cameras {
        let of_view = SplatAsset { cameras: vec![camera.clone()], ..SplatAsset::default() };
        let image = images(&mut backend, asset, &of_view);
        let view = &expected["views"][&camera.name];
        assert_eq!(
            (view["width"].as_u64(), view["height"].as_u64()),
            (Some(camera.width_px.into()), Some(camera.height_px.into()))
        );
        let pixels = view["pixels"].as_array().unwrap();
        assert_eq!(pixels.len(), 20);
        for pixel in pixels {
            let [x, y] = ["x", "y"].map(|k| pixel[k].as_u64().unwrap() as usize);
            for c in 0..3 {
                let found = image[3 * (y * camera.width_px as usize + x) + c];
                max = max.max((f64::from(found) - pixel["rgb"][c].as_f64().unwrap()).abs());
            }
        }
    }
    max
}

#[test]
fn the_pack_renders_to_its_expected_pixels() {
    let expected: Value =
        serde_json::from_slice(&std::fs::read(folder().join("expected.json")).unwrap()).unwrap();
    let scene = read("lossless.glb");
    assert_eq!((scene.num_splats(), scene.sh_degree, scene.cameras.len()), (36, 3, 3));
    let exact = max_error(&scene, &expected);
    println!("lossless {exact:e}");
    // Needed 1.1e-6: the CPU backend computes in f32.
    assert!(exact < 1e-4, "{exact}");
    for camera in &scene.cameras {
        let of_view = SplatAsset { cameras: vec![camera.clone()], ..SplatAsset::default() };
        let found = images(&mut CpuBackend::new(Some(2)).unwrap(), &scene, &of_view);
        let png = image::open(folder().join(format!("{}.png", camera.name))).unwrap().into_rgb8();
        let off = found
            .iter()
            .zip(png.as_raw())
            .map(|(v, &code)| (255.0 * v.clamp(0.0, 1.0) - f32::from(code)).abs());
        // Half a code is rounding.
        assert!(off.fold(0.0, f32::max) < 1.0 && png.len() == found.len(), "{}.png", camera.name);
    }
    for name in ["balanced.glb", "balanced.usda", "balanced.ltgs"] {
        let rounded = max_error(&read(name), &expected);
        println!("{name} {rounded:e}");
        assert!(rounded < 0.02 && rounded > exact, "{name}: {rounded}");
    }
    // Negative control: one splat is missing. The pixels listed show only some, and 11 of them clearly.
    let is_missed = |splat: &usize| {
        let mut other = scene.clone();
        let keep: Vec<bool> = (0..36).map(|i| i != *splat).collect();
        assert_eq!(other.retain(&keep), 1);
        max_error(&other, &expected) > 0.01
    };
    let missed = (0..36).filter(is_missed).count();
    assert!(missed > 8, "{missed}");
}
