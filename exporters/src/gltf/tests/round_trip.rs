//! Files read back as they were written.

use super::*;
use crate::Error;
use crate::gltf::{encode_glb, read_gltf, write_gltf};
use crate::math::yup;

#[test]
fn lossless_keeps_every_bit() {
    for degree in 0..=3 {
        let asset = hard_fixture(300, degree);
        let bytes = encode_glb(&asset, &options(Quality::Lossless)).unwrap();
        assert_eq!(bytes, encode_glb(&asset, &options(Quality::Lossless)).unwrap(), "the same bytes always");
        let read = decode(&bytes).unwrap();
        assert_eq!(difference(&asset, &read.asset), None);
        assert_eq!((read.hash, read.quality), (Some(asset.hash()), Some(Quality::Lossless)));
        assert_eq!(read.warnings, Vec::<String>::new());
        assert_eq!(read.sections.iter().map(|s| s.bytes).sum::<u64>(), bytes.len() as u64);
        // Negative control: the comparison sees one changed bit.
        let mut other = read.asset.clone();
        other.sh[5] = f32::from_bits(other.sh[5].to_bits() ^ 1);
        assert_eq!(difference(&asset, &other), Some("sh"));
    }
}

#[test]
fn balanced_files_match_their_hash_and_rewriting_is_lossless() {
    let asset = hard_fixture(300, 2);
    let bytes = encode_glb(&asset, &options(Quality::Balanced)).unwrap();
    let read = decode(&bytes).unwrap();
    assert_eq!((read.hash, read.quality), (Some(read.asset.hash()), Some(Quality::Balanced)));
    assert_eq!(read.warnings, Vec::<String>::new());
    let worst = asset.texels.iter().zip(&read.asset.texels).fold(0.0_f32, |w, (a, b)| w.max((a - b).abs()));
    // Half a step of 1/127; needed 3.9e-3.
    assert!(worst > 0.0 && worst < 0.501 / 127.0, "{worst}");
    let mut texels_apart = read.asset.clone();
    texels_apart.texels.clone_from(&asset.texels);
    assert_eq!(difference(&asset, &texels_apart), None);
    assert_eq!(encode_glb(&read.asset, &options(Quality::Balanced)).unwrap(), bytes);
    assert!(bytes.len() < encode_glb(&asset, &options(Quality::Lossless)).unwrap().len());
}

#[test]
fn assets_without_maps_and_with_many_pages_round_trip() {
    let mut bare = fixture(20, 1);
    bare.maps.fill(crate::AssetMap::default());
    bare.texels.clear();
    let many = fixture(9000, 0);
    let small = GltfOptions { quality: Quality::Lossless, page_side: 8, ..GltfOptions::default() };
    for (asset, options, pages) in [
        (&bare, options(Quality::Balanced), 0),
        (&bare, options(Quality::Lossless), 0),
        (&many, small, 257),
        (&many, GltfOptions { quality: Quality::Balanced, page_side: 64, ..GltfOptions::default() }, 2),
    ] {
        let bytes = encode_glb(asset, &options).unwrap();
        let (json, _) = split(&bytes);
        let found = json.pointer(&format!("{OURS}/atlas")).map_or(0, |a| a.as_array().unwrap().len());
        assert!(found >= pages, "{found} pages, expected {pages} or more");
        let read = decode(&bytes).unwrap();
        assert_eq!(read.asset.maps, asset.maps);
        assert_eq!(read.hash, Some(read.asset.hash()));
        if options.quality == Quality::Lossless {
            assert_eq!(difference(asset, &read.asset), None);
        }
    }
}

#[test]
fn highly_compressible_pages_are_read() {
    // No residual anywhere: what training begins with.
    let mut asset = fixture(1, 0);
    asset.maps[0] = crate::AssetMap { rows: 1500, cols: 1000, texel_sizes: [1e-4; 2], ..Default::default() };
    asset.texels = vec![0.0; 3 * 1_500_000];
    let folder = tempfile::tempdir().unwrap();
    for (quality, name) in
        [(Quality::Lossless, "a.gltf"), (Quality::Balanced, "b.gltf"), (Quality::Balanced, "c.glb")]
    {
        let path = folder.path().join(name);
        let options = GltfOptions { quality, ..GltfOptions::default() };
        let written = write_gltf(&path, &asset, &options).unwrap();
        let bytes: u64 = written.iter().map(|p| p.metadata().unwrap().len()).sum();
        println!("{name}: {bytes} bytes");
        assert!(bytes < 100_000, "{name}: {bytes}");
        let read = read_gltf(&path, &ReadLimits::default()).unwrap();
        assert_eq!(difference(&asset, &read.asset), None);
    }
}

#[test]
fn sidecar_files_of_a_gltf_round_trip() {
    let folder = tempfile::tempdir().unwrap();
    let asset = hard_fixture(300, 1);
    for (quality, extension) in [(Quality::Lossless, "exr"), (Quality::Balanced, "png")] {
        let path = folder.path().join("a name ü.gltf");
        let written = write_gltf(&path, &asset, &options(quality)).unwrap();
        let names: Vec<_> = written.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect();
        assert!(names.contains(&format!("a name ü_atlas_0.{extension}").as_str()), "{names:?}");
        assert_eq!((names[0], names[names.len() - 1]), ("a name ü.gltf", "a name ü.bin"));
        let read = read_gltf(&path, &ReadLimits::default()).unwrap();
        let all: u64 = written.iter().map(|p| p.metadata().unwrap().len()).sum();
        assert_eq!(read.sections.iter().map(|s| s.bytes).sum::<u64>(), all);
        assert!(read.sections.iter().any(|s| s.name == "texels" && s.bytes > 0));
        assert_eq!(read.hash, Some(read.asset.hash()));
        if quality == Quality::Lossless {
            assert_eq!(difference(&asset, &read.asset), None);
        }
        // Without its files it says which one.
        let text = std::fs::read(&path).unwrap();
        assert!(matches!(decode(&text), Err(Error::Unsupported { .. })));
        std::fs::remove_file(&written[1]).unwrap();
        let error = read_gltf(&path, &ReadLimits::default()).unwrap_err().to_string();
        assert!(error.contains(names[0]) && error.contains(names[1]), "{error}");
        let path = folder.path().join("one.GLB");
        assert_eq!(write_gltf(&path, &asset, &options(quality)).unwrap(), std::slice::from_ref(&path));
        assert_eq!(read_gltf(&path, &ReadLimits::default()).unwrap().asset, read.asset);
    }
}

#[test]
fn a_failed_write_leaves_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let asset = fixture(30, 0);
    // The last file cannot be written: a folder has its name.
    let path = folder.path().join("scene.gltf");
    std::fs::create_dir_all(path.join("full")).unwrap();
    assert!(matches!(write_gltf(&path, &asset, &options(Quality::Balanced)), Err(Error::Io { .. })));
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left, ["scene.gltf"]);
}

#[test]
fn unwritable_assets_are_refused_with_a_reason() {
    let asset = fixture(3, 0);
    assert!(encode_glb(&SplatAsset::default(), &options(Quality::Lossless)).is_err());
    for page_side in [0, 2, 9000] {
        assert!(encode_glb(&asset, &GltfOptions { page_side, ..GltfOptions::default() }).is_err());
    }
    let named_wrongly = write_gltf(Path::new("scene.bin"), &asset, &GltfOptions::default());
    assert!(matches!(named_wrongly, Err(Error::Invalid { .. })));
    let mut broken = asset;
    broken.opacities[0] = 2.0;
    assert!(matches!(encode_glb(&broken, &options(Quality::Lossless)), Err(Error::Invalid { .. })));
}

#[test]
fn written_files_follow_the_specification() {
    let asset = hard_fixture(300, 1);
    let bytes = encode_glb(&asset, &options(Quality::Balanced)).unwrap();
    let (json, bin) = split(&bytes);
    let at = |pointer: &str| json.pointer(pointer).unwrap_or_else(|| panic!("{pointer} in {json}"));
    assert_eq!(at("/extensionsUsed").as_array().unwrap().len(), 2);
    assert!(json.pointer("/extensionsRequired").is_none());
    assert_eq!(at("/asset/copyright"), "An Author, CC-BY-4.0");
    assert_eq!(at(&format!("{KHR_OBJECT}/kernel")), "ellipse");
    assert_eq!(at(&format!("{KHR_OBJECT}/colorSpace")), "srgb_rec709_display");
    assert_eq!(at(&format!("{PRIMITIVE}/extras/litetex/splats")), 300);
    assert_eq!(at(&format!("{PRIMITIVE}/extras/litetex/hash")), at(&format!("{OURS}/hash")));
    let kept = decode(&bytes).unwrap().asset;
    // Splat 7 by hand: position, thickness, colour.
    let element = |name: &str, size: usize| {
        let accessor =
            &at("/accessors")[at(&format!("{PRIMITIVE}/attributes"))[name].as_u64().unwrap() as usize];
        let view = &at("/bufferViews")[accessor["bufferView"].as_u64().unwrap() as usize];
        assert_eq!(view["target"], 34_962, "{name}");
        let first = view["byteOffset"].as_u64().unwrap_or(0) as usize + 7 * size;
        &bin[first..first + size]
    };
    let floats = |bytes: &[u8]| -> Vec<f32> {
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    };
    let [x, y, z] = asset.positions[7];
    assert_eq!(floats(element("POSITION", 12)), [x, -y, -z]);
    let [u, v] = asset.scales[7];
    assert_eq!(floats(element("KHR_gaussian_splatting:SCALE", 12)), [u, v, 0.01 * u.min(v)]);
    let [w, x, y, z] = yup::rotation(asset.rotations[7]);
    assert_eq!(floats(element("KHR_gaussian_splatting:ROTATION", 16)), [x, y, z, w]);
    let dc = f64::from(asset.sh_of(6)[0]) + kept.mean_residual(6)[0] / 0.282_094_791_773_878_14;
    let linear = (((0.5 + 0.282_094_791_773_878_14 * dc).clamp(0.0, 1.0) + 0.055) / 1.055).powf(2.4);
    let accessor = at(&format!("{PRIMITIVE}/attributes/COLOR_0")).as_u64().unwrap() as usize;
    assert_eq!(at("/accessors")[accessor]["normalized"], true);
    let view = at("/accessors")[accessor]["bufferView"].as_u64().unwrap() as usize;
    let first = at("/bufferViews")[view]["byteOffset"].as_u64().unwrap() as usize + 6 * 8;
    let found = f64::from(u16::from_le_bytes([bin[first], bin[first + 1]])) / 65_535.0;
    // DC went to f32 in the file: needed 7.6e-6, half a step.
    assert!((found - linear).abs() < 1e-5, "{found} {linear}");
    assert!(linear > 0.05, "the curved part");
}
