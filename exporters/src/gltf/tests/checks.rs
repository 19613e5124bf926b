//! Validation accepts our files and reports every broken rule.

use super::*;
use crate::gltf::{encode_glb, validate, write_gltf};
use crate::{Issue, Severity};
use serde_json::json;

fn issues(bytes: &[u8]) -> Vec<Issue> {
    validate(bytes, Path::new(PATH))
}

/// Codes of warnings and errors, each once.
fn codes(bytes: &[u8]) -> Vec<&'static str> {
    let mut codes: Vec<_> =
        issues(bytes).into_iter().filter(|i| i.severity > Severity::Info).map(|i| i.code).collect();
    codes.sort_unstable();
    codes.dedup();
    codes
}

fn file(quality: Quality) -> Vec<u8> {
    encode_glb(&hard_fixture(300, 2), &options(quality)).unwrap()
}

#[test]
fn our_files_pass_validation() {
    for quality in [Quality::Lossless, Quality::Balanced] {
        assert_eq!(issues(&file(quality)), []);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.gltf");
        let written = write_gltf(&path, &hard_fixture(300, 2), &options(quality)).unwrap();
        let text = std::fs::read(&path).unwrap();
        assert_eq!(validate(&text, &path), []);
        // A page that is not an image, and none.
        let page = &written[1];
        std::fs::write(page, b"no image").unwrap();
        assert!(validate(&text, &path).iter().any(|i| i.code == "LT1024"));
        std::fs::remove_file(page).unwrap();
        let found = validate(&text, &path);
        assert!(found.iter().any(|i| i.code == "LT1024" && i.message.contains("scene_atlas_0")), "{found:?}");
    }
}

#[test]
fn broken_json_is_reported() {
    type Change = fn(&mut Value);
    let changes: Vec<(&str, Change)> = vec![
        ("LT1001", |j| j["asset"]["version"] = json!("3.0")),
        ("LT1001", |j| j["extensionsRequired"] = json!(["KHR_draco_mesh_compression"])),
        ("LT1001", |j| j["buffers"][0]["byteLength"] = json!(1u64 << 40)),
        ("LT1001", |j| j["buffers"][0]["uri"] = json!("../x.bin")),
        ("LT1002", |j| drop(j["extensionsUsed"].as_array_mut().unwrap().pop())),
        ("LT1003", |j| j["extensionsRequired"] = json!([crate::gltf::EXTENSION])),
        ("LT1004", |j| {
            let mesh = j["meshes"][0].clone();
            j["meshes"].as_array_mut().unwrap().push(mesh);
        }),
        ("LT1005", |j| j["meshes"][0]["primitives"][0]["mode"] = json!(4)),
        ("LT1006", |j| j.pointer_mut(KHR_OBJECT).unwrap()["kernel"] = json!("box")),
        ("LT1006", |j| j.pointer_mut(KHR_OBJECT).unwrap()["colorSpace"] = json!("sRGB")),
        ("LT1007", |j| drop(attributes(j).remove("KHR_gaussian_splatting:OPACITY"))),
        ("LT1007", |j| accessor(j, "POSITION")["bufferView"] = json!(999)),
        ("LT1007", |j| accessor(j, "POSITION")["byteOffset"] = json!(4)),
        ("LT1007", |j| accessor(j, "POSITION")["sparse"] = json!({"count": 1})),
        ("LT1007", |j| accessor(j, "KHR_gaussian_splatting:SCALE")["type"] = json!("VEC2")),
        ("LT1009", |j| drop(attributes(j).remove("KHR_gaussian_splatting:SH_DEGREE_1_COEF_2"))),
        ("LT1016", |j| drop(attributes(j).remove("COLOR_0"))),
        ("LT1029", |j| j["nodes"][0]["scale"] = json!([1.0, 2.0, 1.0])),
        ("LT1020", |j| j.pointer_mut(OURS).unwrap()["version"] = json!(crate::gltf::VERSION - 1)),
        ("LT1020", |j| j.pointer_mut(OURS).unwrap()["version"] = json!(crate::gltf::VERSION + 1)),
        ("LT1020", |j| j.pointer_mut(OURS).unwrap()["version"] = json!("1")),
        ("LT1021", |j| drop(j.pointer_mut(OURS).unwrap().as_object_mut().unwrap().remove("meta"))),
        ("LT1021", |j| drop(j.pointer_mut(OURS).unwrap().as_object_mut().unwrap().remove("texelSize"))),
        ("LT1021", |j| j.pointer_mut(OURS).unwrap()["shift"] = json!(0)),
        ("LT1021", |j| j.pointer_mut(OURS).unwrap()["shDegree"] = json!(0)),
        ("LT1025", |j| drop(j.pointer_mut(OURS).unwrap().as_object_mut().unwrap().remove("shDegree"))),
        ("LT1021", |j| j.pointer_mut(OURS).unwrap()["hash"] = json!("+123456789abcdef")),
        ("LT1021", |j| j.pointer_mut(OURS).unwrap()["quality"] = json!("best")),
        ("LT1021", |j| j.pointer_mut(OURS).unwrap()["texelSize"] = json!(0)),
        ("LT1022", |j| j.pointer_mut(OURS).unwrap()["atlas"][0]["height"] = json!(4)),
        ("LT1022", |j| j.pointer_mut(OURS).unwrap()["atlas"] = json!([])),
        ("LT1024", |j| j.pointer_mut(OURS).unwrap()["atlas"][0]["width"] = json!(63)),
        ("LT1024", |j| j.pointer_mut(OURS).unwrap()["atlas"][0]["width"] = json!(1_000_000)),
        ("LT1024", |j| drop(j.pointer_mut(OURS).unwrap().as_object_mut().unwrap().remove("decode"))),
        ("LT1024", |j| j.pointer_mut(OURS).unwrap()["decode"]["scale"] = json!(-1.0)),
        ("LT1024", |j| j.pointer_mut(OURS).unwrap()["atlas"][0]["bufferView"] = json!(0)),
        ("LT1025", |j| j.pointer_mut(OURS).unwrap()["meta"]["near"] = json!(0.5)),
        ("LT1025", |j| j.pointer_mut(OURS).unwrap()["decode"]["scale"] = json!(0.003)),
        ("LT1035", |j| j.pointer_mut(OURS).unwrap()["border"] = json!(2)),
        ("LT1035", |j| j.pointer_mut(OURS).unwrap()["border"] = json!(60_000)),
        ("LT1026", |j| {
            drop(j.pointer_mut(KHR_OBJECT).unwrap().as_object_mut().unwrap().remove("extensions"))
        }),
        ("LT1026", |j| drop(j.pointer_mut(PRIMITIVE).unwrap().as_object_mut().unwrap().remove("extensions"))),
        ("LT1027", |j| j.pointer_mut(PRIMITIVE).unwrap()["extras"]["litetex"]["texels"] = json!(7)),
        ("LT1027", |j| drop(j.pointer_mut(PRIMITIVE).unwrap().as_object_mut().unwrap().remove("extras"))),
    ];
    let valid = file(Quality::Balanced);
    for (i, (code, change)) in changes.into_iter().enumerate() {
        let found = codes(&edited(&valid, change));
        assert!(found.contains(&code), "change {i}: expected {code}, found {found:?}");
    }
}

fn attributes(json: &mut Value) -> &mut serde_json::Map<String, Value> {
    json.pointer_mut(PRIMITIVE).unwrap()["attributes"].as_object_mut().unwrap()
}

fn accessor<'a>(json: &'a mut Value, name: &str) -> &'a mut Value {
    let index = attributes(json)[name].as_u64().unwrap() as usize;
    &mut json["accessors"][index]
}

/// First byte of an accessor's data.
fn place(json: &Value, accessor: usize) -> usize {
    let view = json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
    json["bufferViews"][view]["byteOffset"].as_u64().unwrap_or(0) as usize
}

#[test]
fn invalid_splat_values_are_reported() {
    let valid = file(Quality::Lossless);
    let khr = |name: &str| format!("KHR_gaussian_splatting:{name}");
    let cases = [
        ("LT1012", khr("ROTATION"), 0.9_f32),
        ("LT1012", khr("ROTATION"), f32::NAN),
        ("LT1013", khr("SCALE"), 0.0),
        ("LT1013", khr("SCALE"), -0.1),
        ("LT1013", khr("SCALE"), f32::INFINITY),
        ("LT1014", khr("OPACITY"), 1.1),
        ("LT1014", khr("OPACITY"), 0.0),
        ("LT1029", khr("SH_DEGREE_1_COEF_0"), f32::NAN),
        ("LT1029", "POSITION".to_owned(), f32::INFINITY),
        ("LT1025", "POSITION".to_owned(), 5.0),
        ("LT1025", khr("SH_DEGREE_1_COEF_0"), 0.123),
    ];
    for (code, name, value) in cases {
        let (mut json, mut bin) = split(&valid);
        let index = attributes(&mut json)[&name].as_u64().unwrap() as usize;
        let at = place(&json, index);
        // Some value of splat 0 in the middle of the range of rotations.
        bin[at..at + 4].copy_from_slice(&value.to_le_bytes());
        let found = codes(&join(&json, bin));
        assert!(found.contains(&code), "{name} {value}: expected {code}, found {found:?}");
    }
}

#[test]
fn plain_gltf_is_left_to_its_own_validator() {
    let valid = file(Quality::Balanced);
    type Change = fn(&mut Value);
    let changes: [Change; 4] = [
        |j| j["nodes"][0]["extensions"] = json!({"EXT_other": {}}),
        |j| accessor(j, "COLOR_0")["count"] = json!(299),
        |j| accessor(j, "POSITION")["max"] = json!([9.0, 9.0, 9.0]),
        |j| j["images"][0]["name"] = json!(7),
    ];
    for (i, change) in changes.into_iter().enumerate() {
        assert_eq!(codes(&edited(&valid, change)).is_empty(), i < 3, "change {i}");
    }
}

#[test]
fn rectangles_and_texels_are_checked() {
    let valid = file(Quality::Lossless);
    let (json, bin) = split(&valid);
    let rects = place(&json, json.pointer(OURS).unwrap()["rects"].as_u64().unwrap() as usize);
    // Splats 0 and 3 have maps of 2 x 2; splat 1 has none.
    let mut overlapping = bin.clone();
    overlapping.copy_within(rects..rects + 4, rects + 24);
    assert!(codes(&join(&json, overlapping)).contains(&"LT1023"));
    let mut outside = bin.clone();
    outside[rects + 1] = 0xff;
    assert!(codes(&join(&json, outside)).contains(&"LT1022"));
    let mut half = bin.clone();
    half[rects + 8 + 4] = 3;
    assert!(codes(&join(&json, half)).contains(&"LT1021"));
    let view = json.pointer(OURS).unwrap()["atlas"][0]["bufferView"].as_u64().unwrap() as usize;
    let at = json["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
    let page = &json.pointer(OURS).unwrap()["atlas"][0];
    let [x, y] = [0, 2].map(|k| usize::from(u16::from_le_bytes([bin[rects + k], bin[rects + k + 1]])));
    let first = at + 12 * (y * page["width"].as_u64().unwrap() as usize + x);
    let mut wild = bin.clone();
    wild[first..first + 4].copy_from_slice(&1.5_f32.to_le_bytes());
    assert!(codes(&join(&json, wild)).contains(&"LT1024"));
    assert_eq!(codes(&join(&json, bin)), Vec::<&str>::new(), "negative control: joined again it is valid");
}

#[test]
fn a_broken_fallback_is_reported() {
    for quality in [Quality::Lossless, Quality::Balanced] {
        let valid = file(quality);
        let (mut json, bin) = split(&valid);
        let mut at = |name: &str| {
            let index = attributes(&mut json)[name].as_u64().unwrap() as usize;
            place(&json, index)
        };
        let khr = |name: &str| format!("KHR_gaussian_splatting:{name}");
        let (dc, scale, colour) = (at(&khr("SH_DEGREE_0_COEF_0")), at(&khr("SCALE")), at("COLOR_0"));
        let changed = |at: usize, bytes: &[u8]| {
            let mut bin = bin.clone();
            bin[at..at + bytes.len()].copy_from_slice(bytes);
            codes(&join(&json, bin))
        };
        let five: Vec<u8> = 5.0_f32.to_le_bytes().repeat(3 * 300);
        assert_eq!(changed(dc, &five), ["LT1031"]);
        // A map of one code more or less would be within the tolerance; a hundredth of a colour is not.
        let old = f32::from_le_bytes(bin[dc + 24..dc + 28].try_into().unwrap());
        assert_eq!(changed(dc + 24, &(old + 0.036).to_le_bytes()), ["LT1031"]);
        assert_eq!(changed(dc + 24, &(old + 1e-4).to_le_bytes()), Vec::<&str>::new());
        for thickness in [1000.0_f32, 0.0] {
            assert_eq!(changed(scale + 8, &thickness.to_le_bytes()), ["LT1032"]);
        }
        assert_eq!(changed(colour, &[0; 8 * 300]), ["LT1033"]);
        // Numbers that are not finite are not read, either.
        let mut bin = bin.clone();
        bin[dc..dc + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(decode(&join(&json, bin)).unwrap_err().to_string().contains("not finite"));
    }
}
