//! Colours for viewers without splat support.

use crate::SplatAsset;
use crate::math::sh::SH_0;

/// `COLOR_0` of a splat: linear light of SH degree 0, and opacity.
pub fn vertex_colour(asset: &SplatAsset, splat: usize, dc: [f32; 3]) -> [u16; 4] {
    let code = |v: f64| (65_535.0 * v).round() as u16;
    let light = |c: f32| asset.colour_space.linear((0.5 + SH_0 * f64::from(c)).clamp(0.0, 1.0));
    let [r, g, b] = dc.map(|c| code(light(c)));
    [r, g, b, code(asset.opacities[splat].into())]
}
