//! Writes the scene that independent renderers are checked with (`tests/python/run_second.py`), in several formats:
//! `cargo run --example conformance -- FOLDER`
//!
//! Every rule of rendering decides pixels of it: SH of degrees 0 to 3, rectangular maps on several atlas pages,
//! with unequal texel sizes and shifts, off-centre principal points, unequal focal lengths, a coloured background; splats
//! behind the camera and around the near plane, seen edge-on, opaque on top of each other, of equal depth, and as faint as
//! 1/255. Seeded: the same files every time.

use litetex_exporters::gltf::{GltfOptions, write_gltf};
use litetex_exporters::usd::{UsdOptions, write_usd};
use litetex_exporters::{
    AssetCamera, AssetMap, ColourSpace, Filter, Provenance, Quality, Result, SplatAsset, Transform,
    atomic_file, ltgs, num_sh_coefficients,
};
use std::path::Path;

const SPLATS: usize = 520;
const NEAR: f32 = 0.25;
/// Rows and columns of maps; (0, 0): none. Few are square, so that a transposed one is seen.
const MAP_SIZES: [(u16, u16); 9] =
    [(1, 1), (2, 7), (16, 3), (0, 0), (9, 12), (40, 8), (5, 64), (1, 20), (24, 24)];
/// SH degrees of splats, as far as the scene has them.
const DEGREES: [u32; 5] = [3, 1, 3, 0, 2];
/// So small that there are several pages.
const PAGE_SIDE: u16 = 128;
/// Bytes behind the stand-in of the pack after which it is no longer shown: in the middle of the texels.
const STAND_IN_UNTIL_BYTES: u64 = 5000;

/// Kinds of splats (`placed`), and the one of opaque splats on top of each other.
const KINDS: usize = 20;
const STACKED: usize = 9;
/// Kind of splats at the centre of the one before: equal depths, drawn by index.
const TWIN: usize = 11;

/// Numbers of a linear congruential generator.
struct Random(u64);

impl Random {
    /// In [0, 1), 24 bits.
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    /// In [low, high).
    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A unit quaternion wxyz.
    fn rotation(&mut self) -> [f64; 4] {
        loop {
            let q: [f64; 4] = std::array::from_fn(|_| f64::from(self.between(-1.0, 1.0)));
            let square: f64 = q.iter().map(|v| v * v).sum();
            if (0.05..=1.0).contains(&square) {
                return q.map(|v| v / square.sqrt());
            }
        }
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}

/// The rotation wxyz that brings the z axis to a unit vector (not the opposite of z).
fn rotation_to_normal(n: [f64; 3]) -> [f64; 4] {
    let q = [1.0 + n[2], -n[1], n[0], 0.0];
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / length)
}

/// A camera at `eye` that looks to `target`, y down, upright.
fn camera(
    name: &str,
    eye: [f64; 3],
    target: [f64; 3],
    size_px: [u32; 2],
    lens_px: [[f64; 2]; 2],
) -> AssetCamera {
    let forward = unit(std::array::from_fn(|i| target[i] - eye[i]));
    let right = unit(cross([0.0, 1.0, 0.0], forward));
    let rotation_rows = [right, cross(forward, right), forward];
    let translation = rotation_rows.map(|row| -(row[0] * eye[0] + row[1] * eye[1] + row[2] * eye[2]));
    AssetCamera {
        name: name.to_owned(),
        held_out: false,
        width_px: size_px[0],
        height_px: size_px[1],
        focal_px: lens_px[0],
        principal_px: lens_px[1],
        rotation_rows,
        translation,
    }
}

fn cameras() -> Vec<AssetCamera> {
    vec![
        camera("wide", [0.0; 3], [0.0, 0.0, 2.0], [200, 150], [[150.5, 178.25], [83.75, 91.5]]),
        camera("side", [1.9, -1.4, 0.2], [-0.1, 0.2, 2.1], [168, 184], [[231.0, 205.5], [101.25, 63.5]]),
        camera("inside", [-0.2, 0.35, 1.6], [0.3, -0.15, 3.5], [208, 136], [[121.5, 117.0], [131.25, 50.75]]),
    ]
}

/// Centre, rotation wxyz and opacity of a splat, by its kind.
fn placed(kind: usize, random: &mut Random) -> ([f32; 3], [f64; 4], f32) {
    let z = match kind {
        // Around the near plane of the first camera, and behind it; not on it, where one bit decides.
        0 => NEAR * [-0.8, 0.3, 0.9, 1.1, 1.5][(5.0 * random.unit()) as usize] + random.between(-0.02, 0.02),
        STACKED => random.between(0.5, 0.62),
        _ => random.between(0.8, 4.0),
    };
    let spread = if kind == 0 { 0.6 * z.abs() + 0.05 } else { 0.55 * z };
    let mut position = [random.between(-spread, spread), random.between(-spread, spread), z];
    if kind == STACKED {
        // Behind each other, so that pixels see two clamped alphas in a row.
        let sight = [[-0.3, -0.2], [0.2, 0.3], [0.35, -0.25]][(3.0 * random.unit()) as usize];
        position = [sight[0] * z, sight[1] * z, z];
    }
    let sight = unit(position.map(f64::from));
    let rotation = match kind {
        1 => {
            // Edge-on for the first camera, on both sides of the limit of 0.001.
            let any = std::array::from_fn(|_| f64::from(random.between(0.1, 1.0)));
            let across = unit(cross(sight, any));
            let lean = [0.0003, 0.002, 0.02, 0.08][(4.0 * random.unit()) as usize];
            rotation_to_normal(unit(std::array::from_fn(|i| across[i] + lean * sight[i])))
        }
        STACKED => rotation_to_normal(sight),
        _ => random.rotation(),
    };
    let opacity = match kind {
        2 | 3 => random.between(0.8, 3.0) / 255.0,
        4 => random.between(0.02, 0.1),
        5..=8 => random.between(0.99, 1.0),
        STACKED => 1.0,
        _ => random.between(0.1, 0.98),
    };
    (position, rotation, opacity)
}

/// Texels of a map: waves of its own, a slope and noise, so that every misplacement shows.
fn texels(rows: u16, cols: u16, random: &mut Random) -> Vec<f32> {
    let mut out = Vec::new();
    let mean: [f32; 3] = std::array::from_fn(|_| random.between(-0.4, 0.4));
    let slopes: [[f32; 2]; 3] =
        std::array::from_fn(|_| [random.between(-0.5, 0.5), random.between(-0.5, 0.5)]);
    for i in 0..rows {
        for j in 0..cols {
            let u = (f32::from(i) + 0.5) / f32::from(rows) - 0.5;
            let v = (f32::from(j) + 0.5) / f32::from(cols) - 0.5;
            let checker = if (i / 2 + j / 2) % 2 == 0 { 0.2 } else { -0.2 };
            for c in 0..3 {
                let wave = slopes[c][0] * u + slopes[c][1] * v + checker + random.between(-0.25, 0.25);
                out.push((mean[c] + wave).clamp(-1.0, 1.0));
            }
        }
    }
    out
}

/// A scene of splats of these kinds, local frame (y down).
fn scene(sh_degree: u32, kinds: impl Iterator<Item = usize>) -> SplatAsset {
    let mut random = Random(20_260_726);
    let mut asset = SplatAsset {
        sh_degree,
        near: NEAR,
        filter: Filter::Ewa,
        background: [0.125, 0.4, 0.7],
        cameras: cameras(),
        capture_from_local: Transform {
            scale: 2.5,
            rotation: [0.5, -0.5, 0.1, 0.7],
            translation: [10.0, -3.0, 0.5],
        },
        ..SplatAsset::default()
    };
    asset.provenance.title = "Conformance scene".to_owned();
    let mut offset_texels = 0;
    for (splat, kind) in kinds.enumerate() {
        let (position, rotation, opacity) = placed(kind, &mut random);
        let sigmas: [f32; 2] = std::array::from_fn(|_| {
            let share = random.unit();
            if kind == STACKED { 0.06 + 0.02 * share } else { 0.02 + 0.3 * share * share * share }
        });
        let twin = asset.positions.last().copied().filter(|_| kind == TWIN);
        asset.positions.push(twin.unwrap_or(position));
        asset.rotations.push(rotation.map(|v| v as f32));
        asset.scales.push(sigmas);
        asset.opacities.push(opacity);
        let degree = sh_degree.min(DEGREES[splat % DEGREES.len()]);
        asset.sh_degrees.push(degree as u8);
        for k in 0..num_sh_coefficients(degree) {
            let reach = [1.2, 0.4, 0.25, 0.2][[0, 1, 1, 1, 2, 2, 2, 2, 2].get(k).copied().unwrap_or(3)];
            asset.sh.extend((0..3).map(|_| random.between(-reach, reach)));
        }
        asset.sh.resize((splat + 1) * 3 * num_sh_coefficients(sh_degree), 0.0);
        let (rows, cols) = MAP_SIZES[splat % MAP_SIZES.len()];
        // From half of the disc to beyond its end.
        let reach = random.between(0.8, 3.5);
        let mut map = AssetMap { offset_texels, rows, cols, ..AssetMap::default() };
        if rows > 0 {
            let sizes = [sigmas[0] / f32::from(rows), sigmas[1] / f32::from(cols)].map(|k| 2.0 * reach * k);
            let coarser = sizes[0].max(sizes[1]);
            map.texel_sizes = [[coarser; 2], sizes, [coarser, 0.5 * coarser]][splat % 3];
            map.shift = [[0, 0], [1, -2], [rows as i16, 0], [-3, 5]][splat % 4];
        }
        asset.maps.push(map);
        offset_texels += u32::from(rows) * u32::from(cols);
        asset.texels.extend(texels(rows, cols, &mut random));
    }
    asset
}

/// A scene of a few kilobytes for `samples/conformance`: fewer splats, images of half the size.
fn small() -> SplatAsset {
    let mut asset = scene(3, (0..36).map(|splat| splat % KINDS));
    for camera in &mut asset.cameras {
        camera.width_px /= 2;
        camera.height_px /= 2;
        camera.focal_px = camera.focal_px.map(|v| v / 2.0);
        camera.principal_px = camera.principal_px.map(|v| v / 2.0);
    }
    asset
}

/// A stand-in of the scene: every third splat, without textures, SH and cameras.
fn without_details(scene: &SplatAsset) -> SplatAsset {
    let mut asset = scene.untextured();
    asset.retain(&(0..asset.num_splats()).map(|splat| splat % 3 == 0).collect::<Vec<_>>());
    let width = 3 * num_sh_coefficients(asset.sh_degree);
    asset.sh.chunks_exact_mut(width).for_each(|sh| sh[3..].fill(0.0));
    asset.sh_degrees.fill(0);
    asset.fit_sh_degree();
    let SplatAsset { near, filter, background, .. } = asset;
    SplatAsset { cameras: Vec::new(), provenance: Provenance::default(), near, filter, background, ..asset }
}

/// The pack that authors of viewers begin with.
fn write_pack(folder: &Path) -> Result<()> {
    let asset = small();
    let gltf = |quality| GltfOptions { quality, page_side: PAGE_SIDE, ..GltfOptions::default() };
    write_gltf(&folder.join("lossless.glb"), &asset, &gltf(Quality::Lossless))?;
    write_gltf(&folder.join("balanced.glb"), &asset, &gltf(Quality::Balanced))?;
    let usd =
        UsdOptions { quality: Quality::Balanced, page_side: PAGE_SIDE, mesh: false, ..UsdOptions::default() };
    write_usd(&folder.join("balanced.usda"), &asset, &usd)?;
    let path = folder.join("balanced.ltgs");
    let options = ltgs::LtgsOptions { quality: Quality::Balanced, ..ltgs::LtgsOptions::default() };
    atomic_file::write(&path, &ltgs::encode(&asset, &options)?)?;
    let stand_in = ltgs::encode(&without_details(&asset), &options)?;
    let stand_in = Some(ltgs::StandIn { file: &stand_in, until_bytes: STAND_IN_UNTIL_BYTES });
    let path = folder.join("stand-in.ltgs");
    atomic_file::write(&path, &ltgs::encode(&asset, &ltgs::LtgsOptions { stand_in, ..options })?)?;
    let path = folder.join("coder.json");
    atomic_file::write(&path, ltgs::coder_vectors().as_bytes())?;
    Ok(())
}

fn main() -> Result<()> {
    let Some(folder) = std::env::args().nth(1) else {
        println!("usage: conformance FOLDER [--pack]");
        return Ok(());
    };
    let folder = Path::new(&folder);
    if std::env::args().nth(2).as_deref() == Some("--pack") {
        return write_pack(folder);
    }
    let mut asset = scene(3, (0..SPLATS).map(|splat| splat % KINDS));
    // Base colours below 0 in one channel, which are clamped before residuals are added.
    for (splat, sh) in asset.sh.chunks_exact_mut(3 * num_sh_coefficients(3)).enumerate().step_by(7) {
        sh[splat % 3] = -2.4;
    }
    let linear = SplatAsset {
        colour_space: ColourSpace::LinRec709Display,
        ..scene(1, (0..120).map(|splat| splat % KINDS))
    };
    let opaque = scene(0, (0..24).map(|_| STACKED));
    let gltf = |name: &str, asset: &SplatAsset, quality| {
        write_gltf(
            &folder.join(name),
            asset,
            &GltfOptions { quality, page_side: PAGE_SIDE, ..GltfOptions::default() },
        )
    };
    let usd = |name: &str, quality| {
        let options = UsdOptions { quality, page_side: PAGE_SIDE, mesh: false, ..UsdOptions::default() };
        write_usd(&folder.join(name), &asset, &options)
    };
    gltf("lossless.glb", &asset, Quality::Lossless)?;
    gltf("balanced.glb", &asset, Quality::Balanced)?;
    gltf("lossless.gltf", &asset, Quality::Lossless)?;
    gltf("linear.glb", &linear, Quality::Lossless)?;
    gltf("opaque.glb", &opaque, Quality::Lossless)?;
    usd("lossless.usda", Quality::Lossless)?;
    usd("balanced.usdc", Quality::Balanced)?;
    usd("balanced.usdz", Quality::Balanced)?;
    println!("{} splats, {} texels in {}", asset.num_splats(), asset.num_texels(), folder.display());
    Ok(())
}
