//! Programs without texture support get the scene with averaged maps.

mod common;

use litetex_exporters::{
    Format, Quality, ReadLimits, SplatAsset, WriteOptions, read_asset, read_fallback, write_asset,
};

fn options(quality: Quality) -> WriteOptions<'static> {
    WriteOptions { quality, ..WriteOptions::default() }
}

/// Whether anything that is rendered differs, bit for bit.
fn differs(a: &SplatAsset, b: &SplatAsset) -> bool {
    a.hash() != b.hash() || a.cameras != b.cameras || a.capture_from_local != b.capture_from_local
}

#[test]
fn the_fallback_equals_the_scene_with_averaged_maps() {
    let folder = tempfile::tempdir().expect("a folder");
    let asset = common::scene(60, 2);
    for format in Format::ALL {
        for quality in [Quality::Lossless, Quality::Balanced] {
            let path = folder.path().join("scene").with_extension(format.extension());
            write_asset(&path, &asset, &options(quality)).expect("written");
            let limits = ReadLimits::default();
            let fallback = read_fallback(&path, &limits).expect("read");
            if matches!(format, Format::Ltgs | Format::Html | Format::Ply | Format::Spz) {
                assert_eq!(fallback, None);
                continue;
            }
            let mut fallback = fallback.expect("a fallback");
            // Coefficients of 0 above a splat's degree may have changed their signs with the frame.
            fallback.sh.iter_mut().for_each(|c| *c += 0.0);
            let textured = read_asset(&path, &limits).expect("read").asset;
            let mut expected = textured.untextured();
            // Other programs know only the degree of the arrays.
            expected.sh_degrees.fill(2);
            if !matches!(format, Format::Glb | Format::Gltf) && quality == Quality::Balanced {
                // USD takes the means before texels are rounded: half a step of 0.8 / 127, which is 0.011 in SH.
                let apart = expected.sh.iter().zip(&fallback.sh).map(|(a, b)| (a - b).abs());
                let apart = apart.fold(0.0, f32::max);
                assert!(apart < 0.011, "{format:?}: {apart}"); // needed 0.0029
                expected.sh.clone_from(&fallback.sh);
            }
            assert!(!differs(&fallback, &expected), "{format:?} {quality:?}");
            // Negative control: the means are not lost.
            let mut plain = textured.untextured();
            plain.sh.copy_from_slice(&textured.sh);
            plain.sh_degrees.fill(2);
            assert!(differs(&fallback, &plain), "{format:?} {quality:?}");
        }
    }
}

#[test]
fn the_fallback_is_read_from_the_file_not_recomputed() {
    let folder = tempfile::tempdir().expect("a folder");
    let asset = common::scene(5, 0);
    let path = folder.path().join("scene.usda");
    write_asset(&path, &asset, &options(Quality::Lossless)).expect("written");
    let text = std::fs::read_to_string(&path).expect("text");
    let name = "radiance:sphericalHarmonicsCoefficients = [";
    let at = text.rfind(name).expect("the last are those of 3D Gaussians") + name.len();
    let end = at + text[at..].find(')').expect("an element") + 1;
    std::fs::write(&path, format!("{}(5, 5, 5){}", &text[..at], &text[end..])).expect("written");
    let fallback = read_fallback(&path, &ReadLimits::default()).expect("read").expect("a fallback");
    assert_eq!(fallback.sh_of(0), [5.0; 3]);
    assert_eq!(fallback.sh_of(1), asset.untextured_dc(1));
    // Without the prim there is nothing for such programs.
    let gone = text.replace("ParticleField3DGaussianSplat", "Scope");
    std::fs::write(&path, gone).expect("written");
    assert_eq!(read_fallback(&path, &ReadLimits::default()).expect("read"), None);
}
