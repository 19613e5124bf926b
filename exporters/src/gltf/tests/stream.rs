//! Files that hold a `.ltgs` file.

use super::*;
use crate::gltf::stream::MIME_LTGS;
use crate::gltf::{encode_glb, read_fallback, validate};
use crate::ltgs::{LtgsOptions, encode};
use serde_json::json;

fn tiny() -> (SplatAsset, Vec<u8>) {
    let asset = hard_fixture(40, 3);
    let glb = encode_glb(&asset, &options(Quality::Tiny)).unwrap();
    (asset, glb)
}

/// Codes of the issues of a file.
fn codes(glb: &[u8]) -> Vec<&'static str> {
    validate(glb, Path::new(PATH)).iter().map(|issue| issue.code).collect()
}

#[test]
fn a_streamed_file_holds_the_scene_of_its_stream() {
    let (asset, glb) = tiny();
    let contents = decode(&glb).unwrap();
    let stream = encode(&asset, &LtgsOptions { quality: Quality::Tiny, ..LtgsOptions::default() }).unwrap();
    let expected = crate::ltgs::decode(&stream, Path::new("a.ltgs"), &ReadLimits::default()).unwrap();
    assert_eq!(difference(&contents.asset, &expected.asset), None);
    assert_eq!((contents.quality, contents.hash), (Some(Quality::Tiny), Some(expected.asset.hash())));
    assert_eq!((contents.warnings.clone(), validate(&glb, Path::new(PATH))), (Vec::new(), Vec::new()));
    let total: u64 = contents.sections.iter().map(|section| section.bytes).sum();
    assert_eq!(total, glb.len() as u64);
    let of = |name: &str| contents.sections.iter().find(|s| s.name == name).map_or(0, |s| s.bytes);
    assert_eq!(of("texels"), expected.sections.iter().find(|s| s.name == "texels").unwrap().bytes);
    let (json, _) = split(&glb);
    assert!(json.pointer(OURS).unwrap().get("meta").is_none(), "the stream has the metadata");
    assert!(json.get("images").is_none());
}

#[test]
fn other_viewers_see_the_splats_of_the_stream() {
    // One splat of the harder scene has no normal in f32.
    let glb = encode_glb(&fixture(40, 3), &options(Quality::Tiny)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    std::fs::write(&path, &glb).unwrap();
    let fallback = read_fallback(&path, &ReadLimits::default()).unwrap();
    let mut expected = decode(&glb).unwrap().asset.untextured();
    expected.limit_sh_degree(0);
    assert_eq!((fallback.sh_degree, &fallback.sh), (0, &expected.sh));
    assert_eq!(Meta::of(&fallback), Meta::of(&expected));
    assert_eq!((&fallback.positions, &fallback.opacities), (&expected.positions, &expected.opacities));
    // Normals, since ellipsoids may be read with their axes exchanged.
    let normal = |[w, x, y, z]: [f32; 4]| {
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z]
    };
    let pairs = fallback.rotations.iter().zip(&expected.rotations).map(|(&a, &b)| (normal(a), normal(b)));
    let dot = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
    let cosines = pairs.map(|(a, b)| dot(a, b).abs() / (dot(a, a) * dot(b, b)).sqrt());
    // Half a step of 16 bits in each of four numbers; f32 leaves 1e-6.
    let least = cosines.fold(1.0, f32::min);
    assert!(least > 1.0 - 2e-6, "{least}");
}

#[test]
fn streamed_files_that_contradict_themselves_are_refused() {
    let (_, glb) = tiny();
    let message = |glb: &[u8]| decode(glb).map_or_else(|error| error.to_string(), |_| "reads".to_owned());
    let changed = |change: &dyn Fn(&mut Value)| edited(&glb, |json| change(json.pointer_mut(OURS).unwrap()));
    let (exact, _) = split(&encode_glb(&hard_fixture(40, 3), &options(Quality::Lossless)).unwrap());
    let meta = exact.pointer(OURS).unwrap()["meta"].clone();
    for (file, expected, code) in [
        (changed(&|ours| ours["meta"] = meta.clone()), "beside", "LT1021"),
        (changed(&|ours| ours["shDegree"] = json!(0)), "\"shDegree\" beside", "LT1021"),
        (changed(&|ours| ours["decode"] = json!({"scale": 1.0, "bias": 0.0})), "beside", "LT1021"),
        (changed(&|ours| ours["atlas"] = json!([])), "beside", "LT1021"),
        (changed(&|ours| drop(ours.as_object_mut().unwrap().remove("stream"))), "neither", "LT1021"),
        (changed(&|ours| ours["stream"]["mimeType"] = json!("image/png")), MIME_LTGS, "LT1021"),
        (changed(&|ours| ours["stream"]["bufferView"] = json!(99)), "bufferView 99", "LT1021"),
        (changed(&|ours| ours["stream"]["bufferView"] = json!(1)), "LTGS", "LT3001"),
        (changed(&|ours| ours["hash"] = json!("0123456789abcdef")), "another hash", "LT1029"),
        (changed(&|ours| ours["quality"] = json!("lossless")), "quality \"lossless\"", "LT1029"),
    ] {
        assert!(message(&file).contains(expected), "{expected}: {}", message(&file));
        assert!(codes(&file).contains(&code), "{expected}: {:?}", codes(&file));
    }
    let (json, bin) = split(&glb);
    let stream = json.pointer(OURS).unwrap()["stream"]["bufferView"].as_u64().unwrap() as usize;
    let end = |view: &Value| {
        (view["byteOffset"].as_u64().unwrap_or(0) + view["byteLength"].as_u64().unwrap()) as usize
    };
    let mut damaged = bin.clone();
    damaged[end(&json["bufferViews"][stream]) - 1] ^= 1;
    let damaged = join(&json, damaged);
    assert!(message(&damaged).contains("checksum") && codes(&damaged).contains(&"LT3004"));
    let position = json.pointer(PRIMITIVE).unwrap()["attributes"]["POSITION"].as_u64().unwrap() as usize;
    let view = json["accessors"][position]["bufferView"].as_u64().unwrap() as usize;
    let mut moved = bin.clone();
    moved[json["bufferViews"][view]["byteOffset"].as_u64().unwrap_or(0) as usize + 2] ^= 0x40;
    let moved = join(&json, moved);
    assert!(codes(&moved).contains(&"LT1034"), "{:?}", codes(&moved));
    for name in ["KHR_gaussian_splatting:ROTATION", "KHR_gaussian_splatting:OPACITY"] {
        let accessor = json.pointer(PRIMITIVE).unwrap()["attributes"][name].as_u64().unwrap() as usize;
        let view = json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
        let first = json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
        let mut other = bin.clone();
        (0..4).for_each(|byte| other.swap(first + byte, first + 4 + byte));
        let other = join(&json, other);
        assert!(codes(&other).contains(&"LT1034"), "{name}: {:?}", codes(&other));
    }
}

#[test]
fn the_first_layers_of_a_streamed_file_are_read() {
    let mut asset = fixture(9000, 0);
    asset.cameras.clear();
    let glb = encode_glb(&asset, &options(Quality::Tiny)).unwrap();
    let limits = ReadLimits { layers: Some(1), ..ReadLimits::default() };
    let first = decode_glb(&glb, Path::new(PATH), &limits).unwrap();
    assert_eq!(first.layers.len(), 3);
    assert_eq!((first.asset.num_splats() as u64, first.hash), (first.layers[0].splats, None));
}
