//! The specification agrees with the code: its worked example is reproduced from a file by the rules of the text alone,
//! and the JSON schema covers everything that is written.

use super::*;
use crate::AssetMap;
use crate::gltf::encode_glb;
use crate::math::yup;

const SPECIFICATION: &str = include_str!("../../../schema/gltf.md");
const SCHEMA: &str = include_str!("../../../schema/LITETEX_gaussian_splatting_texture.schema.json");

/// The scene of section 11.
fn worked_example() -> SplatAsset {
    let sh = [[0.5, 0.0, -1.0], [0.25, 0.5, 0.0], [0.0, 0.25, 0.5], [0.5, 0.0, 0.25]];
    let texels = [
        [0.5, 0.0, 0.0],
        [0.0, 0.5, 0.0],
        [0.0, 0.0, 0.5],
        [0.25, 0.25, 0.0],
        [0.0, 0.25, 0.25],
        [-0.5, 0.0, 0.25],
    ];
    SplatAsset {
        sh_degree: 1,
        sh_degrees: vec![1],
        positions: vec![yup::position([0.25, -0.125, -2.0])],
        rotations: vec![yup::rotation_back([0.8, 0.0, 0.6, 0.0])],
        scales: vec![[0.25, 0.125]],
        opacities: vec![0.75],
        sh: yup::sh(sh.as_flattened()).collect(),
        maps: vec![AssetMap { rows: 2, cols: 3, texel_sizes: [0.25; 2], ..AssetMap::default() }],
        texels: texels.as_flattened().to_vec(),
        near: 0.0625,
        background: [0.125, 0.25, 0.5],
        ..SplatAsset::default()
    }
}

type Vector = [f64; 3];

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A file's numbers, by accessor.
struct File {
    json: Value,
    bin: Vec<u8>,
}

impl File {
    fn numbers<T>(&self, accessor: &Value, size: usize, number: impl Fn(&[u8]) -> T) -> Vec<T> {
        let accessor = &self.json["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &self.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        self.view(view).chunks_exact(size).map(number).collect()
    }

    fn view(&self, view: &Value) -> &[u8] {
        let first = view["byteOffset"].as_u64().unwrap_or(0) as usize;
        &self.bin[first..first + view["byteLength"].as_u64().unwrap() as usize]
    }

    fn floats(&self, accessor: &Value) -> Vec<f64> {
        self.numbers(accessor, 4, |b| f32::from_le_bytes(b.try_into().unwrap()).into())
    }
}

/// Sections 5 to 7 for a file of one splat: named results of the steps.
fn drawn(file: &File) -> Vec<(&'static str, Vec<f64>)> {
    let attributes = &file.json.pointer(PRIMITIVE).unwrap()["attributes"];
    let khr = |name: &str| file.floats(&attributes[format!("KHR_gaussian_splatting:{name}")]);
    let ours = file.json.pointer(OURS).unwrap();
    let centre: Vector = file.floats(&attributes["POSITION"]).try_into().unwrap();
    let flip = |v: Vector| [v[0], -v[1], -v[2]];
    let q: Vec<f64> = khr("ROTATION");
    let axis = |e| flip(crate::math::quaternion::turned([q[3], q[0], q[1], q[2]], e));
    let (p, [e_u, e_v, n]) = (flip(centre), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(axis));
    let (focal, [cx, cy], pixel) = (100.0, [32.0, 24.0], [42.5, 31.5]);

    let r = [(pixel[0] - cx) / focal, (pixel[1] - cy) / focal, 1.0];
    let t = dot(p, n) / dot(r, n);
    let from_centre: Vector = std::array::from_fn(|i| t * r[i] - p[i]);
    let (a, b) = (dot(e_u, from_centre), dot(e_v, from_centre));
    let (sigma, opacity) = (khr("SCALE"), khr("OPACITY")[0]);
    let falloff = (-0.5 * ((a / sigma[0]).powi(2) + (b / sigma[1]).powi(2))).exp();
    let alpha = (opacity * falloff).min(0.99);

    let rect = file.numbers(&ours["rects"], 2, |b| u16::from_le_bytes(b.try_into().unwrap()));
    let [x, y, cols, rows] = [0, 1, 2, 3].map(|i| i64::from(rect[i]));
    let sizes = file.floats(&ours["texelSize"]);
    let shift = match ours.get("shift") {
        Some(shift) => file.numbers(shift, 2, |b| i16::from_le_bytes(b.try_into().unwrap()).into()),
        None => vec![0.0; 2],
    };
    let coordinate =
        |axis: usize, a: f64, count: i64| a / sizes[axis] + (count as f64 - 1.0) / 2.0 - shift[axis] / 2.0;
    let (u, v) = (coordinate(0, a, rows), coordinate(1, b, cols));
    assert!((-1.0..rows as f64).contains(&u) && (-1.0..cols as f64).contains(&v));
    let page = &ours["atlas"][0];
    let texels: Vec<f64> = file
        .view(&file.json["bufferViews"][page["bufferView"].as_u64().unwrap() as usize])
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()).into())
        .collect();
    let texel = |i: i64, j: i64, c: usize| {
        let inside = (0..rows).contains(&i) && (0..cols).contains(&j);
        let at = (y + i) * page["width"].as_i64().unwrap() + x + j;
        if inside { texels[3 * at as usize + c] } else { 0.0 }
    };
    let (i, j, f, g) = (u.floor() as i64, v.floor() as i64, u - u.floor(), v - v.floor());
    let residual: Vector = std::array::from_fn(|c| {
        (1.0 - f) * ((1.0 - g) * texel(i, j, c) + g * texel(i, j + 1, c))
            + f * ((1.0 - g) * texel(i + 1, j, c) + g * texel(i + 1, j + 1, c))
    });

    let d = centre.map(|v| v / dot(centre, centre).sqrt());
    const Y_1: f64 = 0.488_602_511_902_919_9;
    let basis = [0.282_094_791_773_878_14, -Y_1 * d[1], Y_1 * d[2], -Y_1 * d[0]];
    let coefficients = [
        file.floats(&ours["sh0"]),
        khr("SH_DEGREE_1_COEF_0"),
        khr("SH_DEGREE_1_COEF_1"),
        khr("SH_DEGREE_1_COEF_2"),
    ];
    let sum = |c: usize| 0.5 + (0..4).map(|k| basis[k] * coefficients[k][c]).sum::<f64>();
    let base: Vector = std::array::from_fn(|c| sum(c).max(0.0));
    let colour: Vector = std::array::from_fn(|c| (base[c] + residual[c]).max(0.0));
    let behind: Vec<f64> =
        ours["meta"]["background"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let drawn = (0..3).map(|c| alpha * colour[c] + (1.0 - alpha) * behind[c]).collect();
    vec![
        ("r, t, D", [&r[..], &[t, p[2] / t]].concat()),
        ("a, b", vec![a, b]),
        ("G, alpha", vec![falloff, alpha]),
        ("u, v", vec![u, v]),
        ("residual", residual.to_vec()),
        ("d; Y_0 to Y_3", [&d[..], &basis[..]].concat()),
        ("base", [&base[..], &[sum(2)]].concat()),
        ("colour", colour.to_vec()),
        ("pixel", drawn),
    ]
}

/// Numbers of a line of a table.
fn numbers(line: &str) -> Vec<f64> {
    line.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
        .filter_map(|word| word.trim_end_matches('.').parse().ok())
        .collect()
}

#[test]
fn the_worked_example_matches_the_file() {
    let bytes = encode_glb(&worked_example(), &options(Quality::Lossless)).unwrap();
    let (json, bin) = split(&bytes);
    let results = drawn(&File { json, bin });
    let (_, example) = SPECIFICATION.split_once("## 11.").unwrap();
    let (centred, _) = example.split_once("unequal texel sizes").unwrap();
    let mut compared = 0;
    for (name, found) in &results {
        // The last row of that name: inputs stand above results.
        let line = centred.lines().rfind(|l| l.starts_with(&format!("| {name} |"))).unwrap();
        let (_, results) = line.split_once(" | ").unwrap();
        let told = numbers(results);
        for (told, found) in told.iter().zip(found) {
            // Six decimals, and 0.6 and 0.8 as f32: needed 5.0e-7.
            assert!((told - found).abs() < 7e-7, "{name}: {told} {found} in {line:?}");
            compared += 1;
        }
    }
    // Unequal texel sizes and a shift.
    let mut shifted = worked_example();
    (shifted.maps[0].texel_sizes, shifted.maps[0].shift) = ([0.125, 0.25], [-3, 1]);
    let (json, bin) = split(&encode_glb(&shifted, &options(Quality::Lossless)).unwrap());
    for (name, found) in drawn(&File { json, bin }) {
        let Some(line) = example.lines().find(|l| l.starts_with(&format!("| shifted {name} |"))) else {
            continue;
        };
        for (told, found) in numbers(line.split_once(" | ").unwrap().1).iter().zip(&found) {
            assert!((told - found).abs() < 7e-7, "shifted {name}: {told} {found}");
            compared += 1;
        }
    }
    assert_eq!(compared, 39, "all numbers were compared");
    // Negative control: one wrong texel shows.
    let mut other = worked_example();
    other.texels[4] += 0.001;
    let (json, bin) = split(&encode_glb(&other, &options(Quality::Lossless)).unwrap());
    let wrong = drawn(&File { json, bin });
    assert!((wrong[8].1[1] - results[8].1[1]).abs() > 1e-4);
}

#[test]
fn constants_of_the_specification_match_the_code() {
    let direction = [0.48, -0.6, 0.64];
    let [x, y, z] = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    // What follows the constant in each row, by hand.
    let shapes = [
        1.0,
        y,
        z,
        x,
        x * y,
        y * z,
        2.0 * zz - xx - yy,
        x * z,
        xx - yy,
        y * (3.0 * xx - yy),
        x * y * z,
        y * (4.0 * zz - xx - yy),
        z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        x * (4.0 * zz - xx - yy),
        z * (xx - yy),
        x * (xx - 3.0 * yy),
    ];
    for (k, expected) in crate::math::sh::basis(direction).into_iter().enumerate() {
        let row = SPECIFICATION.lines().find(|l| l.starts_with(&format!("| {k} | `"))).unwrap();
        let constant: f64 =
            row.split('|').nth(3).unwrap().split_whitespace().next().unwrap().parse().unwrap();
        assert!((constant * shapes[k] - expected).abs() < 1e-15, "{row}");
    }
    let signs: String = yup::SH_SIGNS
        .iter()
        .map(|s| if *s > 0.0 { "+ " } else { "- " })
        .collect::<String>()
        .trim_end()
        .to_owned();
    assert!(SPECIFICATION.contains(&format!("`{signs}`")), "{signs}");
}

#[test]
fn the_json_schema_covers_every_written_property() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let keys = |v: &Value| v.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    let mut seen = 0;
    for quality in [Quality::Lossless, Quality::Balanced] {
        let mut asset = hard_fixture(9000, 0);
        asset.set_scale(0.01);
        let (json, _) = split(&encode_glb(&asset, &options(quality)).unwrap());
        let ours = json.pointer(OURS).unwrap();
        for (value, definition) in [
            (ours, &schema),
            (&ours["atlas"][0], &schema["$defs"]["page"]),
            (&ours["meta"], &schema["$defs"]["meta"]),
            (&ours["meta"]["provenance"], &schema["$defs"]["meta"]["properties"]["provenance"]),
            (&ours["meta"]["captureFromLocal"], &schema["$defs"]["similarity"]),
            (&ours["meta"]["worldFromCapture"], &schema["$defs"]["similarity"]),
            (&ours["meta"]["cameras"][0], &schema["$defs"]["camera"]),
        ] {
            let known = keys(&definition["properties"]);
            for key in keys(value) {
                assert!(known.contains(&key), "{key} is not in the schema: {known:?}");
                seen += 1;
            }
            for key in definition["required"].as_array().unwrap() {
                assert!(value.get(key.as_str().unwrap()).is_some(), "{key} is required, but not written");
            }
        }
    }
    assert!(seen > 60, "{seen}");
}
