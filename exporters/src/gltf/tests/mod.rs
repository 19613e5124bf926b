//! Round trips, hand-made files and damaged files.

mod checks;
mod foreign;
mod hostile;
mod quads;
mod round_trip;
mod schema;
mod stream;

use super::{GltfOptions, decode_glb};
use crate::asset::meta::Meta;
use crate::asset::tests::fixture;
use crate::{AssetCamera, Contents, Quality, ReadLimits, SplatAsset, Transform};
use serde_json::Value;
use std::path::Path;

const PATH: &str = "test.glb";

fn decode(bytes: &[u8]) -> crate::Result<Contents> {
    decode_glb(bytes, Path::new(PATH), &ReadLimits::default())
}

fn options(quality: Quality) -> GltfOptions<'static> {
    GltfOptions { quality, page_side: 64, ..GltfOptions::default() }
}

/// The fixture with numbers that are easily lost on the way, cameras, and a turned frame.
fn hard_fixture(num_splats: usize, sh_degree: u32) -> SplatAsset {
    let mut asset = fixture(num_splats, sh_degree);
    asset.positions[0] = [-0.0, 1e-42, -0.0];
    asset.rotations[1] = [-0.0, 0.0, -1.0, -0.0];
    asset.rotations[2] = [0.0, -0.0, 0.0, 1.0];
    asset.scales[0][1] = f32::MIN_POSITIVE;
    asset.opacities[1] = 1.0;
    asset.sh[0] = -0.0;
    let last = asset.own_sh_of(0).len() - 1;
    asset.sh[last] = -0.0;
    asset.texels[0..3].copy_from_slice(&[-0.0, 1e-41, -1.0]);
    asset.near = 0.1 + f32::EPSILON;
    asset.background = [0.1, 0.0, 1.0];
    let rotation = [0.5, -0.1, 0.7, 0.5];
    asset.capture_from_local =
        Transform { scale: 1.0 / 3.0, rotation, translation: [1e6 / 7.0, -0.1, 5e-324] };
    asset.cameras = vec![AssetCamera {
        held_out: true,
        name: "a \"quoted\" ü.png".into(),
        width_px: 640,
        height_px: 480,
        focal_px: [500.1, 499.9],
        principal_px: [320.25, 1.0 / 3.0],
        rotation_rows: [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]],
        translation: [0.1, 0.2, 1e-17],
    }];
    asset.provenance.author = "An Author".into();
    asset.provenance.licence = "CC-BY-4.0".into();
    asset.provenance.training.insert("steps".into(), "7000".into());
    asset.validate().unwrap();
    asset
}

/// What differs between two assets, by name; every bit counts.
fn difference(a: &SplatAsset, b: &SplatAsset) -> Option<&'static str> {
    let differ =
        |a: &[f32], b: &[f32]| a.len() != b.len() || a.iter().zip(b).any(|(x, y)| x.to_bits() != y.to_bits());
    let checks = [
        ("degree", a.sh_degree != b.sh_degree),
        ("degrees", a.sh_degrees != b.sh_degrees),
        ("positions", differ(a.positions.as_flattened(), b.positions.as_flattened())),
        ("rotations", differ(a.rotations.as_flattened(), b.rotations.as_flattened())),
        ("scales", differ(a.scales.as_flattened(), b.scales.as_flattened())),
        ("opacities", differ(&a.opacities, &b.opacities)),
        ("sh", differ(&a.sh, &b.sh)),
        ("texels", differ(&a.texels, &b.texels)),
        ("maps", a.maps != b.maps),
        ("meta", Meta::of(a) != Meta::of(b)),
        ("hash", a.hash() != b.hash()),
    ];
    checks.into_iter().find(|(_, differs)| *differs).map(|(name, _)| name)
}

/// JSON and BIN chunk of a `.glb`.
fn split(glb: &[u8]) -> (Value, Vec<u8>) {
    let parts = super::container::parts(glb, Path::new(PATH)).unwrap();
    (serde_json::from_slice(parts.json).unwrap(), parts.bin.unwrap().to_vec())
}

fn join(json: &Value, bin: Vec<u8>) -> Vec<u8> {
    super::container::glb(serde_json::to_vec(json).unwrap(), bin).unwrap()
}

/// The file with its JSON changed.
fn edited(glb: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut json, bin) = split(glb);
    change(&mut json);
    join(&json, bin)
}

/// JSON pointers of what is changed most.
const PRIMITIVE: &str = "/meshes/0/primitives/0";
const KHR_OBJECT: &str = "/meshes/0/primitives/0/extensions/KHR_gaussian_splatting";
const OURS: &str =
    "/meshes/0/primitives/0/extensions/KHR_gaussian_splatting/extensions/LITETEX_gaussian_splatting_texture";
