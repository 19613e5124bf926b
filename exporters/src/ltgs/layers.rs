//! Layers of a lossy file. The splats that contribute most come first, so that the beginning of a file is a coarser scene.

use super::header::CHUNK_SPLATS;
use crate::math::quaternion::turned;
use crate::{AssetCamera, SplatAsset, num_sh_coefficients};
use std::f64::consts::TAU;
use std::ops::Range;

/// Shares of the bytes of all splats, as estimated, at which the first two of three layers end.
const ENDS: [f64; 2] = [1.0 / 8.0, 1.0 / 3.0];

/// Scenes of fewer splats have one layer.
const LAYERED_FROM: usize = 2 * CHUNK_SPLATS;

/// Estimated bytes of a splat, of an SH coefficient above degree 0, and of a texel in a tiny file, and the share that an exponent of
/// 1 saves. Measured on four captures: the share of each layer is within 0.02 of the estimate.
const BYTES: [f64; 3] = [8.0, 0.3, 1.0];
const SAVED: f64 = 0.25;

/// A chunk to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannedChunk {
    /// Its layer, from 0.
    pub layer: u32,
    /// Its splats, as places in the order of the file.
    pub splats: Range<usize>,
}

/// The chunks of layers with these numbers of splats.
pub fn chunks(layers: &[usize]) -> Vec<PlannedChunk> {
    let mut all = Vec::new();
    let mut first = 0;
    for (layer, &count) in layers.iter().enumerate() {
        let end = first + count;
        while first < end {
            let next = end.min(first + CHUNK_SPLATS);
            all.push(PlannedChunk { layer: layer as u32, splats: first..next });
            first = next;
        }
    }
    all
}

/// The layer of each splat, by what it contributes; if `contributions` are empty, by an estimate. `exponents`: those of the
/// splats' steps, `[n]`. `[n]`
pub fn layers(asset: &SplatAsset, exponents: &[i32], contributions: &[f32]) -> Vec<u8> {
    let n = asset.num_splats();
    let mut layers = vec![0; n];
    if n < LAYERED_FROM {
        return layers;
    }
    let of = |splat: usize| contributions.get(splat).copied().filter(|c| c.is_finite()).unwrap_or(0.0);
    let weights = match contributions {
        [] => estimated(asset),
        _ => (0..n).map(of).collect(),
    };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
    let bytes = |splat: usize| bytes(asset, exponents[splat], splat);
    let total: f64 = (0..n).map(bytes).sum();
    let mut before = 0.0;
    for splat in order {
        layers[splat] = ENDS.iter().filter(|end| before >= **end * total).count() as u8;
        before += bytes(splat);
    }
    layers
}

/// Estimated bytes of a splat in the file.
fn bytes(asset: &SplatAsset, exponent: i32, splat: usize) -> f64 {
    let rest = num_sh_coefficients(asset.sh_degrees[splat].into()) - 1;
    let [of_splat, of_coefficient, of_texel] = BYTES;
    let bytes = of_splat + of_coefficient * rest as f64 + of_texel * asset.maps[splat].num_texels() as f64;
    bytes * f64::max(1.0 - SAVED * f64::from(exponent), SAVED)
}

/// Opacities times areas in the views of the cameras or, without any, areas of the splats themselves.
fn estimated(asset: &SplatAsset) -> Vec<f32> {
    let of = |splat: usize| {
        let [u, v] = asset.scales[splat].map(f64::from);
        let area = TAU * u * v;
        let opacity = f64::from(asset.opacities[splat]);
        let in_view = |camera: &AssetCamera| area_px(asset, splat, area, camera);
        let seen = if asset.cameras.is_empty() { area } else { asset.cameras.iter().map(in_view).sum() };
        (opacity * seen) as f32
    };
    (0..asset.num_splats()).map(of).collect()
}

/// Pixels that a splat covers in a view; 0 if its centre is not visible.
fn area_px(asset: &SplatAsset, splat: usize, area: f64, camera: &AssetCamera) -> f64 {
    let turn = |v: [f64; 3]| camera.rotation_rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
    let mut centre = turn(asset.positions[splat].map(f64::from));
    centre.iter_mut().zip(camera.translation).for_each(|(c, t)| *c += t);
    let [x, y, z] = centre;
    if z <= f64::from(asset.near) {
        return 0.0;
    }
    let px = [0, 1].map(|i| camera.focal_px[i] * centre[i] / z + camera.principal_px[i]);
    let size_px = [camera.width_px, camera.height_px].map(f64::from);
    if (0..2).any(|i| !(0.0..=size_px[i]).contains(&px[i])) {
        return 0.0;
    }
    let [a, b, c] = turn(turned(asset.rotations[splat].map(f64::from), [0.0, 0.0, 1.0]));
    let slant = (a * x + b * y + c * z).abs() / (x * x + y * y + z * z).sqrt();
    let covered = area * slant * camera.focal_px[0] * camera.focal_px[1] / (z * z);
    covered.min(size_px[0] * size_px[1])
}
