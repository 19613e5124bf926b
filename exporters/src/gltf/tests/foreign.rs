//! Files that other programs have rewritten or made.

use super::*;
use crate::Error;
use crate::gltf::{encode_glb, validate};
use crate::math::{quaternion, yup};
use serde_json::json;

/// A file as tools rewrite it: one interleaved view for all attributes, the other arrays behind it in reverse order,
/// accessors and views in another order, another generator, further properties.
fn shuffled(glb: &[u8]) -> Vec<u8> {
    let (mut json, bin) = split(glb);
    let number = |v: &Value| v.as_u64().unwrap_or(0) as usize;
    let views: Vec<&[u8]> = json["bufferViews"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| &bin[number(&v["byteOffset"])..number(&v["byteOffset"]) + number(&v["byteLength"])])
        .collect();
    let attributes: Vec<usize> =
        json.pointer(PRIMITIVE).unwrap()["attributes"].as_object().unwrap().values().map(number).collect();
    let count = number(&json["accessors"][attributes[0]]["count"]);
    let widths: Vec<usize> = (0..views.len()).map(|v| views[v].len() / count).collect();
    let stride: usize = attributes.iter().map(|&a| widths[a]).sum();
    // Accessor i has view i in what we write.
    let mut out = vec![0; 4];
    for i in 0..count {
        attributes.iter().for_each(|&a| out.extend(&views[a][i * widths[a]..(i + 1) * widths[a]]));
    }
    let mut new_views =
        vec![json!({"buffer": 0, "byteOffset": 4, "byteLength": count * stride, "byteStride": stride,
        "name": "interleaved", "target": 34962})];
    let mut view_of = vec![0; views.len()];
    for old in (0..views.len()).rev().filter(|v| !attributes.contains(v)) {
        out.resize(out.len().next_multiple_of(8), 0xee);
        view_of[old] = new_views.len();
        new_views.push(json!({"buffer": 0, "byteOffset": out.len(), "byteLength": views[old].len()}));
        out.extend(views[old]);
    }
    let mut offset = 0;
    let num_accessors = json["accessors"].as_array().unwrap().len();
    for &a in &attributes {
        json["accessors"][a]["byteOffset"] = json!(offset);
        offset += widths[a];
    }
    for a in 0..num_accessors {
        json["accessors"][a]["bufferView"] = json!(view_of[a]);
    }
    json["accessors"].as_array_mut().unwrap().reverse();
    let moved = |v: &mut Value| *v = json!(num_accessors - 1 - number(v));
    json.pointer_mut(PRIMITIVE).unwrap()["attributes"].as_object_mut().unwrap().values_mut().for_each(moved);
    for name in ["rects", "pages", "texelSize", "shift", "shDegree", "sh0"] {
        if let Some(v) = json.pointer_mut(&format!("{OURS}/{name}")) {
            *v = json!(num_accessors - 1 - number(v));
        }
    }
    let ours = json.pointer_mut(OURS).unwrap();
    for page in ours["atlas"].as_array_mut().unwrap() {
        if let Some(view) = page.get_mut("bufferView") {
            *view = json!(view_of[number(view)]);
        }
    }
    ours["extras"] = json!({"note": [1, 2, {"deep": null}]});
    for image in json.get_mut("images").and_then(Value::as_array_mut).into_iter().flatten() {
        image["bufferView"] = json!(view_of[number(&image["bufferView"])]);
    }
    json["bufferViews"] = json!(new_views);
    json["buffers"][0]["byteLength"] = json!(out.len());
    json["asset"]["generator"] = json!("another program");
    json["nodes"][0]["name"] = json!("renamed");
    json["extras"] = json!("anything");
    join(&json, out)
}

#[test]
fn files_rewritten_by_other_tools_read_as_the_same_asset() {
    let asset = hard_fixture(300, 2);
    for quality in [Quality::Lossless, Quality::Balanced] {
        let original = encode_glb(&asset, &options(quality)).unwrap();
        let rewritten = shuffled(&original);
        assert_ne!(original, rewritten);
        let [a, b] = [&original, &rewritten].map(|bytes| decode(bytes).unwrap());
        assert_eq!(difference(&a.asset, &b.asset), None);
        assert_eq!((b.hash, b.warnings), (a.hash, Vec::new()));
        assert_eq!(b.sections.iter().map(|s| s.bytes).sum::<u64>(), rewritten.len() as u64);
        assert_eq!(validate(&rewritten, Path::new(PATH)), []);
    }
}

#[test]
fn dropped_textures_are_reported() {
    let bytes = encode_glb(&hard_fixture(300, 1), &options(Quality::Balanced)).unwrap();
    let without = edited(&bytes, |j| {
        drop(j.pointer_mut(KHR_OBJECT).unwrap().as_object_mut().unwrap().remove("extensions"));
    });
    let read = decode(&without).unwrap();
    assert_eq!((read.asset.num_texels(), read.hash, read.quality), (0, None, None));
    assert!(read.warnings.iter().any(|w| w.contains("dropped the textures")), "{:?}", read.warnings);
    let nothing = edited(&bytes, |j| {
        drop(j.pointer_mut(PRIMITIVE).unwrap().as_object_mut().unwrap().remove("extensions"));
    });
    let error = decode(&nothing).unwrap_err();
    assert!(
        matches!(&error, Error::Invalid { what, .. } if what.contains("dropped the textures")),
        "{error}"
    );
    let strange = edited(&bytes, |j| {
        let primitive = j.pointer_mut(PRIMITIVE).unwrap().as_object_mut().unwrap();
        primitive.remove("extensions");
        primitive.remove("extras");
    });
    assert!(matches!(decode(&strange), Err(Error::Unsupported { .. })), "negative control: no file of ours");
}

#[test]
fn moved_nodes_are_honoured_and_changed_values_reported() {
    let asset = hard_fixture(30, 0);
    let bytes = encode_glb(&asset, &options(Quality::Lossless)).unwrap();
    let moved = edited(&bytes, |j| j["nodes"][0]["translation"] = json!([1.0, 2.0, 3.0]));
    let read = decode(&moved).unwrap();
    assert_eq!(read.asset.capture_from_local, asset.capture_from_local, "where it came from");
    let place = read.asset.world_from_local().translation;
    let near = |p: [f64; 3]| (0..3).all(|i| (p[i] - [1.0, -2.0, -3.0][i]).abs() < 1e-9); // needed 3e-11: 1.4e5 away
    assert!(near(place) && !near(asset.world_from_local().translation), "{place:?}");
    assert!(read.warnings.iter().any(|w| w.contains("moved")), "{:?}", read.warnings);
    assert_eq!(read.hash, Some(read.asset.hash()), "the place is no part of the image");
    assert!(validate(&moved, Path::new(PATH)).iter().all(|i| i.code == "LT1030"));
    // Rounding a node to f32 is not a move.
    let rounded = edited(&bytes, |j| {
        for v in j["nodes"][0]["rotation"].as_array_mut().unwrap() {
            *v = json!(f64::from(v.as_f64().unwrap() as f32));
        }
    });
    let read = decode(&rounded).unwrap();
    assert_eq!((read.asset.capture_from_local, read.warnings), (asset.capture_from_local, Vec::new()));
    let changed = edited(&bytes, |j| j.pointer_mut(OURS).unwrap()["meta"]["near"] = json!(0.25));
    assert!(decode(&changed).unwrap().warnings.iter().any(|w| w.contains("hash")));
}

/// A file as another program might write it: ellipsoids, as integers where the specification allows them.
fn foreign_file(quaternions: &[[f64; 4]], scales: &[[f32; 3]]) -> Vec<u8> {
    let n = scales.len();
    let mut bin: Vec<u8> = Vec::new();
    let mut views = Vec::new();
    let mut push = |bytes: Vec<u8>| {
        bin.resize(bin.len().next_multiple_of(4), 0);
        views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
        bin.extend(bytes);
    };
    push((0..3 * n).flat_map(|i| (i as f32).to_le_bytes()).collect());
    let code = |v: f64| (32_767.0 * v).round() as i16;
    push(
        quaternions
            .iter()
            .flat_map(|&[w, x, y, z]| [x, y, z, w])
            .flat_map(|v| code(v).to_le_bytes())
            .collect(),
    );
    push(scales.iter().flatten().flat_map(|v| v.to_le_bytes()).collect());
    push([255, 128, 0, 51].into_iter().cycle().take(n).collect());
    push((0..3 * n).flat_map(|i| (0.1 * i as f32).to_le_bytes()).collect());
    let accessor = |view: usize, kind: u32, shape: &str, normalized: bool| json!({"bufferView": view, "componentType": kind, "type": shape, "count": n, "normalized": normalized});
    let json = json!({
        "asset": {"version": "2.0", "generator": "other 1.0", "copyright": "CC0"},
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "scenes": [{"nodes": [0]}], "nodes": [{"children": [1], "scale": [2, 2, 2]}, {"mesh": 0}],
        "meshes": [{"primitives": [{
            "mode": 0,
            "attributes": {"POSITION": 0, "KHR_gaussian_splatting:ROTATION": 1, "KHR_gaussian_splatting:SCALE": 2,
                "KHR_gaussian_splatting:OPACITY": 3, "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0": 4},
            "extensions": {"KHR_gaussian_splatting": {"kernel": "ellipse", "colorSpace": "lin_rec709_display"}}
        }]}],
        "accessors": [accessor(0, 5126, "VEC3", false), accessor(1, 5122, "VEC4", true),
            accessor(2, 5126, "VEC3", false), accessor(3, 5121, "SCALAR", true), accessor(4, 5126, "VEC3", false)],
        "bufferViews": views, "buffers": [{"byteLength": bin.len()}]
    });
    join(&json, bin)
}

#[test]
fn ellipsoids_become_surfels_along_their_two_largest_axes() {
    let norm = |q: [f64; 4]| q.map(|v| v / quaternion::norm(q));
    let quaternions = [
        norm([0.5, -0.1, 0.7, 0.5]),
        norm([0.9, 0.3, 0.1, -0.2]),
        [1.0, 0.0, 0.0, 0.0],
        norm([0.1, 0.2, 0.3, 0.4]),
    ];
    let scales = [[0.5, 0.25, 1e-6], [1e-6, 0.25, 0.5], [0.5, 0.0, 0.25], [0.5, 0.3, 0.25]];
    let bytes = foreign_file(&quaternions, &scales);
    let read = decode(&bytes).unwrap();
    let asset = &read.asset;
    assert_eq!((asset.num_splats(), asset.num_texels(), asset.sh_degree), (4, 0, 0));
    assert_eq!(asset.colour_space, crate::ColourSpace::LinRec709Display);
    assert_eq!(asset.positions[1], [3.0, -4.0, -5.0]);
    assert_eq!(asset.opacities, [1.0, 128.0 / 255.0, f32::MIN_POSITIVE, 0.2]);
    assert_eq!(asset.capture_from_local.scale, 2.0);
    assert_eq!(asset.provenance.licence, "CC0");
    assert!(read.warnings.iter().any(|w| w.starts_with("1 of 4 splats are thick")), "{:?}", read.warnings);
    // The covariance without the thinnest axis, in the file's frame.
    for i in 0..4 {
        let axes = |q: [f64; 4]| {
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| quaternion::turned(q, e))
        };
        let covariance = |axes: [[f64; 3]; 3], s: &[f32]| -> [f64; 9] {
            std::array::from_fn(|k| {
                (0..s.len()).map(|a| f64::from(s[a]).powi(2) * axes[a][k / 3] * axes[a][k % 3]).sum()
            })
        };
        let mut kept = scales[i];
        let thinnest = (0..3).fold(0, |best, k| if kept[k] < kept[best] { k } else { best });
        kept[thinnest] = 0.0;
        let expected = covariance(axes(quaternions[i]), &kept);
        let found = covariance(axes(yup::rotation(asset.rotations[i]).map(f64::from)), &asset.scales[i]);
        let worst = (0..9).fold(0.0_f64, |w, k| w.max((expected[k] - found[k]).abs()));
        // 16-bit quaternions: needed 8.6e-6.
        assert!(worst < 3e-5, "{i}: {worst:e}");
        let wrong = covariance(axes(quaternions[(i + 1) % 4]), &kept);
        let off = (0..9).fold(0.0_f64, |w, k| w.max((wrong[k] - found[k]).abs()));
        assert!(off > 1e-2, "negative control {off}");
    }
    let issues = validate(&bytes, Path::new(PATH));
    assert!(
        issues.iter().any(|i| i.code == "LT1028") && issues.iter().any(|i| i.code == "LT1014"),
        "{issues:?}"
    );
}

#[test]
fn broken_splats_of_other_programs_are_left_out_but_not_ours() {
    let n = 20;
    let file = |changes: &[(usize, [f64; 4], [f32; 3])]| {
        let mut quaternions = vec![[1.0, 0.0, 0.0, 0.0]; n];
        let mut scales = vec![[0.1, 0.2, 1e-6]; n];
        for &(at, q, s) in changes {
            (quaternions[at], scales[at]) = (q, s);
        }
        foreign_file(&quaternions, &scales)
    };
    let unit = [1.0, 0.0, 0.0, 0.0];
    for (q, s, word) in [
        ([0.0; 4], [0.1; 3], "rotation"),
        (unit, [f32::NAN, 0.1, 0.1], "scales"),
        (unit, [0.1, -0.1, 0.1], "scales"),
    ] {
        let read = decode(&file(&[(7, q, s)])).unwrap();
        assert_eq!((read.asset.num_splats(), read.asset.positions[7][0]), (n - 1, 24.0));
        let warning = &read.warnings[0];
        assert!(
            warning.starts_with("1 of 20 splats is broken and left out: splat 7: ") && warning.contains(word)
        );
    }
    let many = [0, 1, 2].map(|at| (at, [0.0; 4], [0.1; 3]));
    let error = decode(&file(&many)).unwrap_err().to_string();
    assert!(error.contains("3 of 20 splats are broken, more than 10 %"), "{error}");
    assert!(decode(&file(&[])).unwrap().warnings.is_empty(), "negative control");
    // With our extension, one is too many.
    let ours = encode_glb(&hard_fixture(30, 0), &options(Quality::Lossless)).unwrap();
    let (json, mut bin) = split(&ours);
    let at = json.pointer(PRIMITIVE).unwrap()["attributes"]["POSITION"].as_u64().unwrap() as usize;
    let view = json["accessors"][at]["bufferView"].as_u64().unwrap() as usize;
    let offset = json["bufferViews"][view]["byteOffset"].as_u64().unwrap_or(0) as usize;
    bin[offset..offset + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(decode(&join(&json, bin)).unwrap_err().to_string().contains("splat 0: position"));
}

#[test]
fn invalid_foreign_files_are_refused() {
    let bytes = foreign_file(&[[1.0, 0.0, 0.0, 0.0]; 2], &[[0.1, 0.2, 0.3]; 2]);
    type Change = fn(&mut Value);
    let changes: [(&str, Change); 9] = [
        ("require", |j| j["extensionsRequired"] = json!(["KHR_something_new"])),
        ("colorSpace", |j| j.pointer_mut(KHR_OBJECT).unwrap()["colorSpace"] = json!("ACEScg")),
        ("ROTATION", |j| j["accessors"][1]["normalized"] = json!(false)),
        ("SH_DEGREE_0", |j| j["accessors"][4]["componentType"] = json!(5121)),
        ("SCALE", |j| j["accessors"][2]["count"] = json!(1)),
        ("node 1", |j| j["nodes"][1]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1])),
        ("ancestors", |j| j["nodes"][1]["children"] = json!([0])),
        ("mode", |j| j["meshes"][0]["primitives"][0]["mode"] = json!(1)),
        ("version", |j| j["asset"]["version"] = json!("1.0")),
    ];
    assert!(decode(&bytes).is_ok(), "negative control");
    for (word, change) in changes {
        let error = decode(&edited(&bytes, change)).unwrap_err().to_string();
        assert!(error.contains(word), "{word}: {error}");
    }
}
