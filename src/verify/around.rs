//! Views of a scene that has no cameras.

use crate::bake::asset_camera;
use crate::camera::orbit::looking;
use crate::camera::{Camera, Pinhole};
use glam::DVec3;
use litetex_exporters::{AssetCamera, Overview, SplatAsset};

/// Width and height of each image.
const SIDE_PX: u32 = 400;
/// The bulk of the scene fills this angle about the axis of a view, to each side.
const HALF_FIELD_DEGREES: f64 = 30.0;
/// Scenes are taken to be at least this many times as large as the distance of the near plane, which cuts nothing off then.
const NEAR_PLANES: f64 = 10.0;

/// Corners of a cube.
pub const VIEWS_AROUND: usize = 8;

/// Views from the corners of a cube about the bulk of a scene, in its local frame; so no direction need be up. Empty for a
/// scene without splats.
pub fn views_around(scene: &SplatAsset) -> Vec<AssetCamera> {
    let Some(bounds) = Overview::of(scene).bounds else { return Vec::new() };
    let [low, high] = [bounds.min, bounds.max].map(DVec3::from_array);
    let centre = 0.5 * (low + high);
    let radius = (0.5 * low.distance(high)).max(NEAR_PLANES * f64::from(scene.near));
    let half_field = HALF_FIELD_DEGREES.to_radians();
    let focal_px = 0.5 * f64::from(SIDE_PX) / half_field.tan();
    let middle_px = 0.5 * f64::from(SIDE_PX);
    let pinhole = Pinhole {
        width_px: SIDE_PX,
        height_px: SIDE_PX,
        fx_px: focal_px,
        fy_px: focal_px,
        cx_px: middle_px,
        cy_px: middle_px,
    };
    let at_corner = |corner: usize| {
        let along = |bit: usize| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
        let towards = DVec3::new(along(0), along(1), along(2)).normalize();
        let from = centre + radius / half_field.sin() * towards;
        let camera = Camera { pinhole, camera_from_local: looking(from, centre, DVec3::Y) };
        asset_camera(&format!("around-{corner}"), false, &camera)
    };
    (0..VIEWS_AROUND).map(at_corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::camera;

    /// A box of splats with these corners.
    fn scene(low: [f32; 3], high: [f32; 3]) -> SplatAsset {
        let corner =
            |i: usize| std::array::from_fn(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] });
        SplatAsset {
            positions: (0..8).map(corner).collect(),
            rotations: vec![[0.0, 0.0, 0.0, 1.0]; 8],
            scales: vec![[0.01; 2]; 8],
            opacities: vec![0.5; 8],
            ..SplatAsset::default()
        }
    }

    #[test]
    fn every_view_shows_the_whole_scene_beyond_the_near_plane() {
        for (low, high) in [
            ([-1.0, -2.0, 3.0], [4.0, 0.5, 3.5]),
            ([1000.0, 0.0, 0.0], [1003.0, 3.0, 3.0]),
            ([0.0; 3], [1e-3; 3]),
            ([2.0; 3], [2.0; 3]),
        ] {
            let scene = scene(low, high);
            let views = views_around(&scene);
            assert_eq!(views.len(), VIEWS_AROUND);
            for view in &views {
                let camera = camera(view);
                for position in &scene.positions {
                    let at = DVec3::from_array(position.map(f64::from));
                    let seen = camera.camera_from_local.transform_point(at);
                    assert!(seen.z > f64::from(scene.near), "{seen} in {view:?}");
                    let pixel = camera.pinhole.project(seen).unwrap();
                    assert!(
                        pixel.min_element() >= 0.0 && pixel.max_element() <= f64::from(SIDE_PX),
                        "{pixel}"
                    );
                }
            }
        }
        assert!(views_around(&SplatAsset::default()).is_empty());
    }
}
