//! Bakes a trained model into an asset: activations are computed once, in f64, and rounded to the f32 values on
//! which every export is defined. Files belong to `litetex-exporters`.

mod cameras;
mod model_from_asset;

use crate::Report;
use crate::camera::up::Up;
use crate::constants::sh_coefficients;
use crate::model::{Filter, Model, TextureMap, texel_value};
pub use cameras::{AssetViews, asset_camera, asset_cameras, camera};
use litetex_exporters::{
    AssetCamera, AssetMap, ColourSpace, Filter as AssetFilter, Provenance, SplatAsset, Transform,
};
pub use model_from_asset::model_from_asset;

/// Largest standard deviation of a splat in an asset, local units.
const SCALE_MAX: f64 = 1e6;

/// Bakes a model without pending lazy updates, with the cameras of its capture and the colour of its background.
///
/// Splats that no renderer can draw (numbers that are not finite, a zero quaternion, a standard
/// deviation above 1e6) are left out with their maps and counted in the report as
/// `splats-not-drawable`. An empty `program_version` of the provenance is filled in.
pub fn bake(
    model: &Model,
    cameras: Vec<AssetCamera>,
    background: [f32; 3],
    provenance: Provenance,
    report: &mut Report,
) -> SplatAsset {
    let mut asset = SplatAsset {
        sh_degree: model.splats.sh_degree(),
        near: model.near,
        filter: match model.filter {
            Filter::None => AssetFilter::None,
            Filter::Ewa => AssetFilter::Ewa,
        },
        capture_from_local: Transform::scaled_and_moved(
            model.capture_from_local.scale,
            model.capture_from_local.translation.to_array(),
        ),
        colour_space: ColourSpace::SrgbRec709Display,
        background,
        cameras,
        provenance,
        ..SplatAsset::default()
    };
    if asset.provenance.program_version.is_empty() {
        env!("CARGO_PKG_VERSION").clone_into(&mut asset.provenance.program_version);
    }
    let mut dropped = Vec::new();
    for splat in 0..model.num_splats() {
        if push_splat(&mut asset, model, splat).is_none() {
            dropped.push(splat);
        }
    }
    asset.fit_sh_degree();
    if let Some(first) = dropped.first() {
        let what = format!(
            "splats that no renderer can draw were left out of the asset (numbers that are not finite, or \
             absurd scales), the first is number {first}"
        );
        report.warn("splats-not-drawable", dropped.len(), what);
    }
    asset
}

/// Stands an asset upright in files, and notes why there.
pub fn set_up(asset: &mut SplatAsset, up: &Up) {
    asset.set_up(up.in_capture.to_array());
    asset.provenance.up = up.words();
}

/// Activates one splat and its map and appends them; `None`, and no change, if no renderer can draw it.
fn push_splat(asset: &mut SplatAsset, model: &Model, splat: usize) -> Option<()> {
    let s = &model.splats;
    let position: [f32; 3] = s.positions[3 * splat..].first_chunk().copied()?;
    let quaternion: [f32; 4] = s.quaternions[4 * splat..].first_chunk().copied()?;
    let log_scales: [f32; 2] = s.log_scales[2 * splat..].first_chunk().copied()?;
    let opacity = sigmoid(f64::from(s.opacity_logits[splat]));
    let sh = s.sh_of(splat);
    let map = &model.textures.maps[splat];
    let texels = &model.textures.texels[map.floats()];

    let norm = quaternion.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    let scales = log_scales.map(|v| f64::from(v).exp());
    let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
    let drawable = finite(&position)
        && norm > 0.0
        && norm.is_finite()
        && scales.iter().all(|v| *v <= SCALE_MAX)
        && !opacity.is_nan()
        && finite(sh)
        && finite(texels)
        && (map.num_texels() == 0 || map.texel_sizes.iter().all(|size| *size > 0.0 && size.is_finite()));
    if !drawable {
        return None;
    }
    asset.positions.push(position);
    asset.rotations.push(quaternion.map(|v| (f64::from(v) / norm) as f32));
    // An asset's scales and opacities are positive: what underflows becomes the smallest normal number.
    asset.scales.push(scales.map(|v| (v as f32).max(f32::MIN_POSITIVE)));
    asset.opacities.push((opacity as f32).max(f32::MIN_POSITIVE));
    asset.sh.extend(sh);
    // Assets are padded to their largest degree.
    asset.sh.resize(asset.num_splats() * 3 * sh_coefficients(asset.sh_degree), 0.0);
    asset.sh_degrees.push(s.sh_degrees()[splat]);
    // No larger than the model's own offsets, which fit.
    asset.maps.push(asset_map(map, asset.num_texels() as u32));
    asset.texels.extend(texels.iter().map(|&t| texel_value(f64::from(t)) as f32));
    Some(())
}

/// A model's map as assets hold it, at another offset.
fn asset_map(map: &TextureMap, offset_texels: u32) -> AssetMap {
    if map.num_texels() == 0 {
        return AssetMap { offset_texels, ..AssetMap::default() };
    }
    let TextureMap { rows, cols, texel_sizes, shift, .. } = *map;
    AssetMap { offset_texels, rows, cols, texel_sizes, shift }
}

fn sigmoid(logit: f64) -> f64 {
    1.0 / (1.0 + (-logit).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Pinhole, RigidTransform, Similarity};
    use crate::model::{SplatArrays, TextureMap, TexturePool};
    use glam::{DMat3, DVec3};

    /// Four textured or plain splats with awkward but drawable values.
    fn model() -> Model {
        let mut splats = SplatArrays::zeros(4, 1);
        for i in 0..4 {
            splats.positions[3 * i] = i as f32;
            splats.quaternions[4 * i + i] = 0.5 + i as f32;
            splats.quaternions[4 * i] += 0.25;
        }
        splats.log_scales = vec![-3.0, -200.0, 0.0, 1.0, -1.0, -2.0, -3.0, -4.0];
        splats.opacity_logits = vec![0.0, 100.0, -200.0, 1.0];
        splats.sh.iter_mut().enumerate().for_each(|(i, v)| *v = i as f32);
        let mut textures = TexturePool::neutral(
            [(2, 3, 0.1), (0, 0, 0.0), (1, 1, 0.2), (2, 2, 0.3)]
                .map(|(rows, cols, size)| TextureMap::square(rows, cols, size)),
        )
        .unwrap();
        textures.texels.iter_mut().enumerate().for_each(|(i, v)| *v = i as f32 - 9.0);
        Model {
            splats,
            textures,
            near: 0.04,
            filter: Filter::Ewa,
            capture_from_local: Similarity { scale: 2.5, translation: DVec3::new(1.0, 2.0, 3.0) },
        }
    }

    fn camera() -> Camera {
        Camera {
            pinhole: Pinhole {
                width_px: 40,
                height_px: 30,
                fx_px: 35.0,
                fy_px: 36.0,
                cx_px: 20.0,
                cy_px: 15.0,
            },
            camera_from_local: RigidTransform {
                rotation: DMat3::from_rotation_z(0.3),
                translation: DVec3::new(0.1, 0.2, 4.0),
            },
        }
    }

    #[test]
    fn a_baked_model_is_a_valid_asset_with_activated_values() {
        let mut report = Report::default();
        let cameras = vec![asset_camera("a/b.png", true, &camera())];
        let asset = bake(&model(), cameras, [0.25; 3], Provenance::default(), &mut report);
        asset.validate().unwrap();
        assert_eq!(report, Report::default());
        assert_eq!((asset.num_splats(), asset.num_texels()), (4, 11));
        assert_eq!(asset.opacities, [0.5, 1.0, f32::MIN_POSITIVE, (1.0 / (1.0 + (-1.0_f64).exp())) as f32]);
        assert_eq!(asset.scales[0], [(-3.0_f64).exp() as f32, f32::MIN_POSITIVE]);
        assert_eq!(asset.rotations[0], [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(asset.texels[9], 0.0);
        assert_eq!(asset.texels[11], (1.0_f64).tanh() as f32);
        assert_eq!(asset.sh, model().splats.sh);
        // Rows of the rotation turn a local point into the camera's frame.
        let rows = asset.cameras[0].rotation_rows.map(DVec3::from_array);
        let turned = DVec3::from_array(rows.map(|r| r.dot(DVec3::X)));
        assert!((turned - camera().camera_from_local.rotation * DVec3::X).length() < 1e-15); // needed 0
        assert_eq!(asset.provenance.program_version, env!("CARGO_PKG_VERSION"));
    }

    #[test]
    fn splats_that_cannot_be_drawn_are_left_out_and_counted() {
        type Poison = fn(&mut Model);
        let poisons: [Poison; 7] = [
            |m| m.splats.positions[5] = f32::NAN,
            |m| m.splats.quaternions[4..8].fill(0.0),
            |m| m.splats.log_scales[2] = 500.0,
            |m| m.splats.log_scales[3] = f32::NAN,
            |m| m.splats.opacity_logits[1] = f32::NAN,
            |m| m.splats.sh[13] = f32::INFINITY,
            |m| m.splats.quaternions[6] = f32::INFINITY,
        ];
        for poison in poisons {
            let mut poisoned = model();
            poison(&mut poisoned);
            let mut report = Report::default();
            let asset = bake(&poisoned, Vec::new(), [0.0; 3], Provenance::default(), &mut report);
            asset.validate().unwrap();
            assert_eq!((asset.num_splats(), asset.num_texels()), (3, 11));
            assert_eq!(report.warnings[0].count, 1);
        }
        // A poisoned texel takes its splat and its map along; offsets close up.
        let mut poisoned = model();
        poisoned.textures.texels[0] = f32::NAN;
        let asset = bake(&poisoned, Vec::new(), [0.0; 3], Provenance::default(), &mut Report::default());
        asset.validate().unwrap();
        assert_eq!((asset.num_splats(), asset.num_texels()), (3, 5));
        assert_eq!(asset.maps[2].offset_texels, 1);
    }
}
