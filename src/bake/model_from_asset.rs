//! Turns an asset back into a model that backends can render: activations are inverted in f64.

use crate::camera::Similarity;
use crate::model::{Filter, Model, SplatArrays, TextureMap, TexturePool};
use glam::DVec3;
use litetex_exporters::{AssetMap, Filter as AssetFilter, SplatAsset};

/// Largest opacity and residual that can be inverted; f32 rounds it to 1.
const BELOW_ONE: f64 = 1.0 - 1.0 / (1_u64 << 26) as f64;

/// A model that renders as the asset, to the rounding of f32; equal assets give equal models, bit for bit. A
/// rotation of the frame is dropped, since models have none: cameras and splats are in the local frame anyway.
pub fn model_from_asset(asset: &SplatAsset) -> Model {
    let mut splats = SplatArrays::zeros_of(asset.sh_degrees.clone());
    splats.positions = asset.positions.as_flattened().to_vec();
    splats.quaternions = asset.rotations.as_flattened().to_vec();
    splats.log_scales = asset.scales.as_flattened().iter().map(|&s| f64::from(s).ln() as f32).collect();
    splats.opacity_logits = asset.opacities.iter().map(|&o| logit(f64::from(o)) as f32).collect();
    for splat in 0..splats.len() {
        let to = splats.sh_of_mut(splat);
        to.copy_from_slice(&asset.sh_of(splat)[..to.len()]);
    }
    let stored = |v: &f32| 2.0 * f64::from(*v).clamp(-BELOW_ONE, BELOW_ONE).atanh();
    let texels = asset.texels.iter().map(|v| stored(v) as f32).collect();
    let frame = &asset.capture_from_local;
    Model {
        splats,
        textures: TexturePool { maps: asset.maps.iter().map(texture_map).collect(), texels },
        near: asset.near,
        filter: match asset.filter {
            AssetFilter::None => Filter::None,
            AssetFilter::Ewa => Filter::Ewa,
        },
        capture_from_local: Similarity {
            scale: frame.scale,
            translation: DVec3::from_array(frame.translation),
        },
    }
}

/// An asset's map as models hold it.
fn texture_map(map: &AssetMap) -> TextureMap {
    let AssetMap { offset_texels, rows, cols, texel_sizes, shift } = *map;
    TextureMap { offset_texels, rows, cols, texel_sizes, shift }
}

fn logit(opacity: f64) -> f64 {
    let o = opacity.min(BELOW_ONE);
    (o / (1.0 - o)).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Report;
    use crate::bake::bake;
    use litetex_exporters::Provenance;

    #[test]
    fn an_asset_round_trips_through_a_model() {
        let asset = SplatAsset {
            sh_degree: 1,
            sh_degrees: vec![1, 0],
            positions: vec![[1.0, -2.0, 3.0], [0.0, 1e-7, 5.0]],
            rotations: vec![[0.5, -0.5, 0.5, -0.5], [1.0, 0.0, 0.0, 0.0]],
            scales: vec![[1e-6, 0.25], [3.0, 40.0]],
            opacities: vec![1.0, 0.004],
            sh: (0..24).map(|i| if i < 15 { i as f32 / 7.0 - 1.0 } else { 0.0 }).collect(),
            maps: vec![
                AssetMap { rows: 2, cols: 1, texel_sizes: [0.1, 0.2], shift: [0, -3], ..AssetMap::default() },
                AssetMap { offset_texels: 2, ..AssetMap::default() },
            ],
            texels: vec![1.0, -1.0, 0.0, 0.7, -1e-5, 0.999_999],
            ..SplatAsset::default()
        };
        asset.validate().unwrap();
        let again = bake(
            &model_from_asset(&asset),
            Vec::new(),
            [0.0; 3],
            Provenance::default(),
            &mut Report::default(),
        );
        let close = |a: &[f32], b: &[f32]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 2e-6 * a.abs())
        };
        // Needed 3e-7: f32 of the logarithm of 1e-6.
        assert!(close(asset.scales.as_flattened(), again.scales.as_flattened()), "{:?}", again.scales);
        assert!(close(&asset.opacities, &again.opacities) && close(&asset.texels, &again.texels));
        assert_eq!(
            (asset.positions, asset.rotations, asset.sh, asset.sh_degrees),
            (again.positions, again.rotations, again.sh, again.sh_degrees)
        );
        assert_eq!(asset.maps, again.maps);
        // Negative control.
        assert!(!close(&[1.0, 2.0], &[1.0, 2.000_01]));
    }
}
