//! Damaged and hostile files give errors or valid assets, never panics or large allocations.

use super::*;
use crate::Error;
use crate::asset::tests::{damaged, random};
use crate::gltf::{encode_glb, read_gltf, validate, write_gltf};
use serde_json::json;

/// Decodes and checks; a result must be a valid asset.
fn survive(bytes: &[u8], what: &str) -> bool {
    let limits = ReadLimits { decoded_bytes: 64 << 20, layers: None };
    let read = decode_glb(bytes, Path::new(PATH), &limits);
    if let Ok(contents) = &read {
        contents.asset.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
    }
    read.is_ok()
}

#[test]
fn no_truncation_is_accepted() {
    for quality in [Quality::Lossless, Quality::Balanced] {
        let bytes = encode_glb(&hard_fixture(60, 1), &options(quality)).unwrap();
        for share in 0..100 {
            let mut cut = bytes[..bytes.len() * share / 100].to_vec();
            assert!(!survive(&cut, "cut"), "cut to {share} of 100");
            // The same with a header that agrees.
            if cut.len() >= 12 {
                let length = cut.len() as u32;
                cut[8..12].copy_from_slice(&length.to_le_bytes());
                assert!(!survive(&cut, "cut"), "cut to {share} of 100 with its length");
            }
        }
        assert!(survive(&bytes, "whole"), "negative control");
    }
}

#[test]
fn no_damage_makes_the_reader_panic() {
    let mut random = random(3);
    for quality in [Quality::Lossless, Quality::Balanced] {
        let bytes = encode_glb(&hard_fixture(60, 1), &options(quality)).unwrap();
        let json_end = 20 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let mut accepted = 0;
        for round in 0..3000 {
            // Half of them in the JSON, where structure is.
            let end = if round % 2 == 0 { json_end } else { bytes.len() };
            let damaged = damaged(&bytes, 0..end, &mut random);
            accepted += usize::from(survive(&damaged, &format!("round {round}")));
            if round % 20 == 0 {
                drop(validate(&damaged, Path::new(PATH)));
            }
        }
        // Without the hash, most damage to the data goes unnoticed.
        assert!((300..2990).contains(&accepted), "{accepted}");
    }
}

#[test]
fn digits_replaced_by_other_digits_do_not_panic() {
    let bytes = encode_glb(&hard_fixture(60, 1), &options(Quality::Balanced)).unwrap();
    let json_end = 20 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let digits: Vec<usize> = (20..json_end).filter(|&i| bytes[i].is_ascii_digit()).collect();
    let mut random = random(5);
    for round in 0..3000 {
        let mut damaged = bytes.clone();
        for _ in 0..1 + random(3) {
            damaged[digits[random(digits.len())]] = b'0' + random(10) as u8;
        }
        survive(&damaged, &format!("round {round}"));
    }
}

#[test]
fn hostile_counts_offsets_and_sizes_are_refused() {
    let bytes = encode_glb(&hard_fixture(60, 1), &options(Quality::Balanced)).unwrap();
    let huge = [
        json!(u64::MAX),
        json!(u32::MAX),
        json!(1u64 << 40),
        json!(16_777_216),
        json!(-1),
        json!(1.5),
        json!("1"),
    ];
    let (json, _) = split(&bytes);
    // COLOR_0 is for other viewers and not read.
    let unread = json.pointer(PRIMITIVE).unwrap()["attributes"]["COLOR_0"].as_u64().unwrap();
    let image = json["images"][0]["bufferView"].as_u64().unwrap();
    let pointers: Vec<String> = (0..json["accessors"].as_array().unwrap().len())
        .flat_map(|i| {
            ["count", "byteOffset", "bufferView", "componentType"].map(|k| format!("/accessors/{i}/{k}"))
        })
        .chain((0..json["bufferViews"].as_array().unwrap().len()).flat_map(|i| {
            ["byteLength", "byteOffset", "buffer", "byteStride"].map(|k| format!("/bufferViews/{i}/{k}"))
        }))
        .chain(["rects", "texelSize", "shift", "shDegree", "sh0"].map(|k| format!("{OURS}/{k}")))
        .chain(["width", "height", "texture"].map(|k| format!("{OURS}/atlas/0/{k}")))
        .chain(["/buffers/0/byteLength", "/images/0/bufferView", "/nodes/0/mesh"].map(str::to_owned))
        .collect();
    for pointer in &pointers {
        for value in &huge {
            let (parent, name) = pointer.rsplit_once('/').unwrap();
            let hostile = edited(&bytes, |j| j.pointer_mut(parent).unwrap()[name] = value.clone());
            let read = survive(&hostile, pointer);
            // A mesh without a node and an image with a stride are odd, but harmless.
            let harmless = pointer == "/nodes/0/mesh"
                || parent.ends_with(&format!("s/{unread}"))
                || pointer.ends_with(&format!("s/{image}/byteStride"));
            assert!(!read || harmless, "{pointer} = {value}");
        }
    }
}

#[test]
fn excessive_element_counts_and_low_limits_are_refused() {
    let asset = hard_fixture(60, 1);
    let bytes = encode_glb(&asset, &options(Quality::Balanced)).unwrap();
    let tight =
        |decoded_bytes| decode_glb(&bytes, Path::new(PATH), &ReadLimits { decoded_bytes, layers: None });
    assert!(matches!(tight(1000), Err(Error::TooLarge { .. })));
    assert!(tight(60_000).is_ok(), "negative control");
    // A page that a few bytes cannot hold.
    let bomb = edited(&bytes, |j| {
        j.pointer_mut(OURS).unwrap()["atlas"][0]["width"] = json!(8192);
        j.pointer_mut(OURS).unwrap()["atlas"][0]["height"] = json!(8192);
    });
    assert!(
        matches!(decode(&bomb), Err(Error::TooLarge { what, .. }) if what.contains("pages of 67108864 texels"))
    );
    let narrow = edited(&bytes, |j| j.pointer_mut(OURS).unwrap()["atlas"][0]["height"] = json!(8000));
    let narrow = edited(&narrow, |j| j.pointer_mut(OURS).unwrap()["atlas"][0]["width"] = json!(2000));
    assert!(decode(&narrow).unwrap_err().to_string().contains("cannot hold"));
    // The same page a million times over: bounded by the number of pages or by what may be decoded.
    let pages = edited(&bytes, |j| {
        let page = j.pointer(OURS).unwrap()["atlas"][0].clone();
        j.pointer_mut(OURS).unwrap()["atlas"] = json!(vec![page; 100_000]);
    });
    assert!(matches!(decode(&pages), Err(Error::TooLarge { .. })));
    let buffers = edited(&bytes, |j| j["buffers"] = json!(vec![json!({"byteLength": 0}); 2000]));
    assert!(matches!(decode(&buffers), Err(Error::TooLarge { .. })));
    let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    for (pointer, may_be_read) in [("/asset", true), (PRIMITIVE, false), (OURS, false)] {
        let nested = edited(&bytes, |j| j.pointer_mut(pointer).unwrap()["extras"] = json!("DEEP"));
        let (json, bin) = split(&nested);
        let text = serde_json::to_string(&json).unwrap().replace("\"DEEP\"", &deep);
        let nested = crate::gltf::container::glb(text.into_bytes(), bin).unwrap();
        assert_eq!(decode(&nested).is_ok(), may_be_read, "{pointer}");
        let is_refused = validate(&nested, Path::new(PATH)).iter().any(|i| i.code == "LT1001");
        assert_eq!(is_refused, !may_be_read, "{pointer}");
    }
    let long = vec![b' '; crate::gltf::JSON_BYTES_MAX + 1];
    assert!(matches!(decode(&long), Err(Error::TooLarge { .. })));
    assert!(matches!(tight(1 << 30).map(|c| c.asset.num_splats()), Ok(60)));
}

#[test]
fn damaged_sidecar_files_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    let mut random = random(9);
    for quality in [Quality::Lossless, Quality::Balanced] {
        let written = write_gltf(&path, &hard_fixture(60, 0), &options(quality)).unwrap();
        let root = std::fs::read(&path).unwrap();
        let mut json: Value = serde_json::from_slice(&root).unwrap();
        let extension = json.pointer_mut(OURS).and_then(Value::as_object_mut).unwrap();
        assert_eq!(extension.remove("sidecars").unwrap().as_object().unwrap().len(), written.len() - 1);
        // As another program writes it, so that damaged files reach the readers of images.
        let unchecked = json.to_string().into_bytes();
        for file in &written {
            let valid = std::fs::read(file).unwrap();
            for round in 0..60 {
                let mut damaged = valid.clone();
                if round % 3 == 0 {
                    damaged.truncate(valid.len() * round / 60);
                } else {
                    damaged[random(valid.len())] ^= 1 << random(8);
                }
                std::fs::write(file, &damaged).unwrap();
                let is_changed = damaged != valid;
                for has_hashes in [true, false] {
                    if file != &path {
                        std::fs::write(&path, if has_hashes { &root } else { &unchecked }).unwrap();
                    }
                    if let Ok(contents) = read_gltf(&path, &ReadLimits::default()) {
                        contents.asset.validate().unwrap();
                        assert!(round % 3 != 0, "{}: cut, but read", file.display());
                        assert!(
                            file == &path || !has_hashes || !is_changed,
                            "{}: damaged, but read",
                            file.display()
                        );
                    }
                }
            }
            std::fs::write(file, &valid).unwrap();
            std::fs::write(&path, &root).unwrap();
        }
        assert!(read_gltf(&path, &ReadLimits::default()).is_ok(), "negative control");
    }
}
