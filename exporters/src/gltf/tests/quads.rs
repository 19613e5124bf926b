//! The quads reproduce colour, falloff and position of their splats.

use super::*;
use crate::AssetMap;
use crate::gltf::{MeshOptions, encode_mesh};
use crate::math::{quaternion, yup};

fn mesh(asset: &SplatAsset, options: &MeshOptions) -> (Value, Vec<u8>, crate::gltf::MeshSummary) {
    let (bytes, summary) = encode_mesh(asset, options).unwrap();
    assert_eq!(summary.bytes, bytes.len());
    let (json, bin) = split(&bytes);
    (json, bin, summary)
}

fn bytes_of<'a>(json: &Value, bin: &'a [u8], view: usize) -> &'a [u8] {
    let view = &json["bufferViews"][view];
    let first = view["byteOffset"].as_u64().unwrap_or(0) as usize;
    &bin[first..first + view["byteLength"].as_u64().unwrap() as usize]
}

fn floats(json: &Value, bin: &[u8], name: &str) -> Vec<f64> {
    let accessor = json.pointer(PRIMITIVE).unwrap()["attributes"][name].as_u64().unwrap() as usize;
    let view = json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
    let bytes = bytes_of(json, bin, view);
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()).into()).collect()
}

fn pixels(json: &Value, bin: &[u8]) -> ([usize; 2], Vec<u8>) {
    let view = json["images"][0]["bufferView"].as_u64().unwrap() as usize;
    let decoder = png::Decoder::new(std::io::Cursor::new(bytes_of(json, bin, view)));
    let mut reader = decoder.read_info().unwrap();
    assert!(reader.info().srgb.is_some(), "tagged");
    let size = [reader.info().width as usize, reader.info().height as usize];
    let mut rgba = vec![0; 4 * size[0] * size[1]];
    reader.next_frame(&mut rgba).unwrap();
    (size, rgba)
}

#[test]
fn quad_texels_match_the_splats_colours() {
    let mut asset = fixture(3, 0);
    // One large splat whose map has a gradient along u in red and along v in green.
    asset.scales[0] = [0.1, 0.05];
    asset.opacities[0] = 0.9;
    asset.sh[..3].copy_from_slice(&[0.0; 3]);
    asset.maps[0] = AssetMap { rows: 31, cols: 16, texel_sizes: [0.02; 2], ..AssetMap::default() };
    asset.maps[1].offset_texels = 31 * 16;
    asset.maps[2] = AssetMap { offset_texels: 31 * 16, ..AssetMap::default() };
    asset.texels = (0..31 * 16)
        .flat_map(|i| [(i / 16) as f32 / 31.0 - 0.5, (i % 16) as f32 / 16.0 - 0.5, 0.25])
        .collect();
    asset.validate().unwrap();
    let (json, bin, summary) = mesh(&asset, &MeshOptions { quads_max: 1, page_side: 256 });
    assert_eq!((summary.quads, summary.omitted), (1, 2));
    let (points, places) = (floats(&json, &bin, "POSITION"), floats(&json, &bin, "TEXCOORD_0"));
    assert_eq!((points.len(), places.len()), (12, 8));
    let ([width, height], rgba) = pixels(&json, &bin);
    let q = asset.rotations[0].map(f64::from);
    // At each corner, a quarter of the way to the opposite one: the place on the surfel and the texel that is shown there.
    for corner in 0..4 {
        for share in [0.0, 0.25, 0.5] {
            let mix = |v: &[f64], width: usize, k: usize| {
                let opposite = (corner + 2) % 4;
                (1.0 - share) * v[width * corner + k] + share * v[width * opposite + k]
            };
            let point: [f32; 3] = std::array::from_fn(|k| mix(&points, 3, k) as f32);
            let local = yup::position(point);
            let offset: [f64; 3] =
                std::array::from_fn(|k| f64::from(local[k]) - f64::from(asset.positions[0][k]));
            let [a, b, n] = quaternion::turned(quaternion::conjugate(q), offset);
            assert!(n.abs() < 1e-6, "on the surfel: {n}");
            let (x, y) = (mix(&places, 2, 0) * width as f64 - 0.5, mix(&places, 2, 1) * height as f64 - 0.5);
            let at = |x: f64, y: f64| {
                let i = 4 * (y as usize * width + x as usize);
                [0, 1, 2, 3].map(|c| f64::from(rgba[i + c]) / 255.0)
            };
            // Bilinear, as viewers do.
            let (fx, fy) = (x - (x + 1e-4).floor(), y - (y + 1e-4).floor());
            let (x0, y0) = ((x + 1e-4).floor(), (y + 1e-4).floor());
            let (x1, y1) = ((x0 + 1.0).min(width as f64 - 1.0), (y0 + 1.0).min(height as f64 - 1.0));
            let found: [f64; 4] = std::array::from_fn(|c| {
                (1.0 - fy) * ((1.0 - fx) * at(x0, y0)[c] + fx * at(x1, y0)[c])
                    + fy * ((1.0 - fx) * at(x0, y1)[c] + fx * at(x1, y1)[c])
            });
            // Base colour 0.5 and the gradient; it vanishes outside the map, where samples at the corner lie.
            let (u, v) = (a / 0.02 + 15.0, b / 0.02 + 7.5);
            let alpha = 0.9 * (-0.5 * ((a / 0.1).powi(2) + (b / 0.05).powi(2))).exp();
            let mut expected = [0.5 + u / 31.0 - 0.5, 0.5 + v / 16.0 - 0.5, 0.75, alpha];
            (0..3).for_each(|c| expected[c] = expected[c].clamp(0.0, 1.0));
            for c in 0..4 {
                // Codes of 8 bits and the falloff between samples: needed 5.7e-3.
                assert!(
                    (found[c] - expected[c]).abs() < 0.012,
                    "{corner} {share} {c}: {found:?} {expected:?}"
                );
            }
        }
    }
}

#[test]
fn quad_meshes_have_the_expected_counts_and_materials() {
    let asset = fixture(300, 1);
    let (json, _, summary) = mesh(&asset, &MeshOptions { quads_max: 100, page_side: 64 });
    assert_eq!((summary.quads, summary.omitted), (100, 200));
    let primitives = json["meshes"][0]["primitives"].as_array().unwrap();
    assert!(primitives.len() > 1, "one primitive per page");
    let quads: u64 = primitives
        .iter()
        .map(|p| json["accessors"][p["indices"].as_u64().unwrap() as usize]["count"].as_u64().unwrap() / 6)
        .sum();
    assert_eq!(quads, 100);
    for material in json["materials"].as_array().unwrap() {
        assert_eq!((&material["alphaMode"], &material["doubleSided"]), (&"BLEND".into(), &true.into()));
        assert!(material["extensions"]["KHR_materials_unlit"].is_object());
    }
    assert_eq!(json["extensionsUsed"], serde_json::json!(["KHR_materials_unlit"]));
    assert_eq!(encode_mesh(&asset, &MeshOptions::default()).unwrap().1.omitted, 0);
    // The most visible ones are kept: with one quad less, what is lost is the least.
    let mut faint = asset.clone();
    faint.opacities[17] = 0.001;
    assert_eq!(encode_mesh(&faint, &MeshOptions::default()).unwrap().1.omitted, 1);
    assert!(encode_mesh(&asset, &MeshOptions { quads_max: 0, page_side: 64 }).is_err());
    assert!(encode_mesh(&asset, &MeshOptions { quads_max: 10, page_side: 4 }).is_err());
}
