//! Files against files, against damage and against what others make of them.

use super::binary::{binary_from_layer, layer_from_binary};
use super::layer::Layer;
use super::read::Opened;
use super::text_read::layer_from_text;
use super::text_write::text_from_layer;
use super::*;
use crate::asset::tests::fixture;
use crate::atlas::TexelDecode;
use crate::{
    AssetCamera, CaptureFromLocal, Contents, Error, Quality, ReadLimits, Result, Severity, SplatAsset,
};
use std::path::{Path, PathBuf};

const EXTENSIONS: [&str; 3] = ["usda", "usdc", "usdz"];

/// A fixture with everything that an asset can have.
fn full(num_splats: usize, sh_degree: u32) -> SplatAsset {
    let mut asset = fixture(num_splats, sh_degree);
    asset.capture_from_local = CaptureFromLocal {
        scale: 1.0 / 3.0,
        rotation: [0.5, -0.5, 0.5, 0.5],
        translation: [1e6 / 7.0, -0.1, 3.0],
    };
    asset.background = [0.1, 0.2, 1.0];
    asset.positions[0] = [-0.0, 1e-42, 16_777_216.0];
    asset.texels[0] = -0.0;
    asset.provenance.title = "A \"title\" \\ with\nlines, \u{1}, ü and 木".into();
    asset.provenance.training.insert("steps".into(), "7000".into());
    asset.cameras.push(AssetCamera {
        name: "frame 1.png".into(),
        width_px: 640,
        height_px: 480,
        focal_px: [500.5, 501.25],
        principal_px: [320.0, 240.5],
        rotation_rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [0.1, 0.2, 1.0 / 3.0],
    });
    asset
}

fn options(quality: Quality) -> UsdOptions {
    UsdOptions { quality, page_side: 64, mesh: true }
}

fn write(folder: &Path, name: &str, asset: &SplatAsset, quality: Quality) -> PathBuf {
    let path = folder.join(name);
    let files = write_usd(&path, asset, &options(quality)).unwrap();
    assert_eq!(files[0], path);
    assert!(files.iter().all(|f| f.is_file()));
    path
}

fn read(path: &Path) -> Result<Contents> {
    read_usd(path, &ReadLimits::default())
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn lossless_files_give_every_bit_back() {
    let folder = tempfile::tempdir().unwrap();
    for degree in 0..4 {
        let asset = full(100, degree);
        for extension in EXTENSIONS {
            let path = write(folder.path(), &format!("s{degree}.{extension}"), &asset, Quality::Lossless);
            let contents = read(&path).unwrap();
            assert_eq!(contents.asset, asset, "{extension}");
            assert_eq!(bits(&contents.asset.texels), bits(&asset.texels));
            assert_eq!(bits(contents.asset.positions.as_flattened()), bits(asset.positions.as_flattened()));
            assert_eq!(contents.warnings, Vec::<String>::new());
            assert_eq!((contents.quality, contents.hash), (Some(Quality::Lossless), Some(asset.hash())));
            let mut size = std::fs::metadata(&path).unwrap().len();
            if extension != "usdz" {
                let pages = std::fs::read_dir(folder.path().join(format!("s{degree}_textures"))).unwrap();
                let pages = pages.map(|f| f.unwrap()).filter(|f| f.file_name().to_string_lossy().starts_with("page"));
                size += pages.map(|f| f.metadata().unwrap().len()).sum::<u64>();
            }
            assert_eq!(contents.sections.iter().map(|s| s.bytes).sum::<u64>(), size, "{extension}");
            assert!(contents.sections.iter().any(|s| s.name == "positions") || extension == "usda");
        }
    }
}

/// Writes samples for `tests/python/check_usd.py` where `LITETEX_USD_SAMPLES` says.
#[test]
fn samples_for_other_programs() {
    let Some(folder) = std::env::var_os("LITETEX_USD_SAMPLES").map(PathBuf::from) else {
        println!("skipped: LITETEX_USD_SAMPLES names no folder");
        return;
    };
    for (name, asset) in [("small", full(100, 3)), ("large", full(20_000, 1)), ("bare", fixture(0, 0))] {
        for quality in [Quality::Lossless, Quality::Balanced] {
            for extension in EXTENSIONS {
                let name = format!("{name}_{}.{extension}", quality.name());
                write(&folder, &name, &asset, quality);
            }
        }
    }
}
