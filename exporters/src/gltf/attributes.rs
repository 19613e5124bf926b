//! Writes the attributes of splats: exact ones, or small ones for viewers without our extension only.

use super::buffer::{Arrays, Use};
use super::{KHR, colour, sh_attribute, sh_indices};
use crate::SplatAsset;
use crate::math::yup;
use std::collections::BTreeMap;

/// Accessors by the names of their attributes.
pub type AttributeAccessors = BTreeMap<String, u32>;

/// Adds attributes that keep every number; returns them, and the accessor of the exact SH of degree 0 if the attribute
/// differs.
pub fn exact(arrays: &mut Arrays, asset: &SplatAsset) -> (AttributeAccessors, Option<u32>) {
    let (mut attributes, baked) = shared(arrays, asset);
    let n = asset.num_splats();
    attributes.insert(format!("{KHR}:ROTATION"), arrays.push(rotations(asset), Use::Attribute));
    for (k, (l, m)) in sh_indices(asset.sh_degree).enumerate().skip(1) {
        // Without the sign of a zero above the splat's degree.
        let coefficients = (0..n).map(|i| {
            let own = asset.own_sh_of(i).as_chunks::<3>().0.get(k);
            own.map_or([0.0; 3], |coefficient| coefficient.map(|c| yup::SH_SIGNS[k] * c))
        });
        attributes.insert(sh_attribute(l, m), arrays.push(coefficients, Use::Attribute));
    }
    let colours = (0..n).map(|i| colour::vertex_colour(asset, i, baked[i]));
    attributes.insert("COLOR_0".to_owned(), arrays.push(colours, Use::NormalisedAttribute));
    let dc = |i: usize| -> [f32; 3] { std::array::from_fn(|c| asset.sh_of(i)[c]) };
    let is_baked = (0..n).any(|i| dc(i).map(f32::to_bits) != baked[i].map(f32::to_bits));
    let sh0 = is_baked.then(|| arrays.push((0..n).map(dc), Use::Other(None)));
    (attributes, sh0)
}

/// Adds attributes that only viewers without our extension use: of SH degree 0, with rotations of 16 bits and vertex colours
/// of 8. 52 bytes per splat.
pub fn small(arrays: &mut Arrays, asset: &SplatAsset) -> AttributeAccessors {
    let (mut attributes, baked) = shared(arrays, asset);
    let codes = rotations(asset).map(|q| q.map(|v| (32_767.0 * v).round() as i16));
    attributes.insert(format!("{KHR}:ROTATION"), arrays.push(codes, Use::NormalisedAttribute));
    let colours = (0..asset.num_splats()).map(|i| colour::vertex_colour(asset, i, baked[i]));
    let colours = colours.map(|colour| colour.map(|code| ((f32::from(code) / 257.0).round()) as u8));
    attributes.insert("COLOR_0".to_owned(), arrays.push(colours, Use::NormalisedAttribute));
    attributes
}

/// Adds what both have in common; returns it, and colours of degree 0 with the means of the maps.
fn shared(arrays: &mut Arrays, asset: &SplatAsset) -> (AttributeAccessors, Vec<[f32; 3]>) {
    let positions = asset.positions.iter().map(|&p| yup::position(p));
    let scales = asset.scales.iter().map(|&[u, v]| [u, v, yup::thickness(u, v)]);
    let baked: Vec<[f32; 3]> = (0..asset.num_splats()).map(|i| asset.untextured_dc(i)).collect();
    let attributes = BTreeMap::from([
        ("POSITION".to_owned(), arrays.push_positions(positions)),
        (format!("{KHR}:SCALE"), arrays.push(scales, Use::Attribute)),
        (format!("{KHR}:OPACITY"), arrays.push(asset.opacities.iter().map(|&o| [o]), Use::Attribute)),
        (sh_attribute(0, 0), arrays.push(baked.iter().copied(), Use::Attribute)),
    ]);
    (attributes, baked)
}

/// Rotations xyzw of the files' frame.
fn rotations(asset: &SplatAsset) -> impl Iterator<Item = [f32; 4]> {
    asset.rotations.iter().map(|&q| {
        let [w, x, y, z] = yup::rotation(q);
        [x, y, z, w]
    })
}
