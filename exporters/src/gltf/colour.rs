//! Colours for viewers that know no textures.

use crate::sh::SH_0;
use crate::{ColourSpace, SplatAsset};

/// Linear light of an sRGB code value.
pub fn linear_from_srgb(v: f64) -> f64 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// sRGB code value of linear light.
pub fn srgb_from_linear(v: f64) -> f64 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// SH of degree 0 of a splat with the mean of its map in it.
pub fn baked_dc(asset: &SplatAsset, splat: usize) -> [f32; 3] {
    let dc = asset.sh_of(splat);
    if asset.maps[splat].num_texels() == 0 {
        return std::array::from_fn(|c| dc[c]);
    }
    let mean = asset.mean_residual(splat);
    std::array::from_fn(|c| {
        (f64::from(dc[c]) + mean[c] / SH_0).clamp(f32::MIN.into(), f32::MAX.into()) as f32
    })
}

/// `COLOR_0` of a splat: linear light and opacity.
pub fn vertex_colour(asset: &SplatAsset, splat: usize, dc: [f32; 3]) -> [u16; 4] {
    let code = |v: f64| (65_535.0 * v).round() as u16;
    let [r, g, b] = dc.map(|c| {
        let v = (0.5 + SH_0 * f64::from(c)).clamp(0.0, 1.0);
        code(match asset.colour_space {
            ColourSpace::SrgbRec709Display => linear_from_srgb(v),
            ColourSpace::LinRec709Display => v,
        })
    });
    [r, g, b, code(asset.opacities[splat].into())]
}
