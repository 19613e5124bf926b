//! Cameras of the capture as other programs take them: in the frame of the file with y up, looking along -z with y up.

use crate::asset::overview::Overview;
use crate::math::quaternion;
use crate::number::rounded;
use crate::{AssetCamera, SplatAsset};

/// Digits of numbers for other programs: as many as tell any two f32 apart.
pub const DIGITS: usize = 9;

/// Which cameras a file holds for other programs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cameras {
    /// The home view alone: see [`Overview::of`].
    #[default]
    Home,
    /// The home view, then all others in order.
    All,
}

/// A camera in the frame of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct ShownCamera {
    /// Name of the photo.
    pub name: String,
    /// `file_from_camera`, **wxyz**.
    pub rotation: [f64; 4],
    /// The centre, units of the file.
    pub centre: [f64; 3],
    /// Width and height of the image at depth 1.
    pub size: [f64; 2],
    /// From the axis to the middle of the image at depth 1, right and up; 0 if the principal point is in the middle.
    pub offset: [f64; 2],
    /// Near plane, units of the file.
    pub near: f64,
}

impl ShownCamera {
    /// The cameras of an asset, the home view first.
    pub fn of(asset: &SplatAsset, which: Cameras) -> Vec<Self> {
        let Some(home) = Overview::of(asset).home else { return Vec::new() };
        let others = (0..asset.cameras.len()).filter(|&i| i != home && which == Cameras::All);
        std::iter::once(home).chain(others).filter_map(|i| Self::new(asset, &asset.cameras[i])).collect()
    }

    /// `None` for a camera without an image, or with numbers that are not finite.
    fn new(asset: &SplatAsset, camera: &AssetCamera) -> Option<Self> {
        let frame = asset.world_from_local();
        let AssetCamera {
            name, width_px, height_px, focal_px, principal_px, rotation_rows, translation, ..
        } = camera.in_frame(&frame);
        // Half a turn about x on either side: both frames get y up.
        let flip = [1.0, -1.0, -1.0];
        let axes = [0, 1, 2].map(|j| [0, 1, 2].map(|i| flip[i] * rotation_rows[j][i] * flip[j]));
        let along = |i: usize| (0..3).map(|j| rotation_rows[j][i] * translation[j]).sum::<f64>();
        // All digits: captures may lie a million units from the origin of their frame.
        let centre = [0, 1, 2].map(|i| 0.0 - flip[i] * along(i));
        let sides = [f64::from(width_px), f64::from(height_px)];
        let size = [0, 1].map(|i| sides[i] / focal_px[i]);
        let right = (0.5 * sides[0] - principal_px[0]) / focal_px[0];
        let up = (principal_px[1] - 0.5 * sides[1]) / focal_px[1];
        let rotation = quaternion::from_axes(axes).map(|v| rounded(v + 0.0, DIGITS));
        // Other programs need one above 0.
        let near = rounded(f64::from(asset.near) * frame.scale, DIGITS);
        let near = if near > 0.0 { near } else { 1e-3 * frame.scale };
        let numbers = [centre.as_slice(), &size, &[right, up, near], &rotation];
        let is_finite = numbers.concat().iter().all(|v| v.is_finite());
        (is_finite && size.iter().all(|s| *s > 0.0)).then_some(Self {
            name,
            rotation,
            centre,
            size,
            offset: [right, up],
            near,
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    /// An asset with two cameras that are not like each other, in a frame that is turned and scaled.
    pub(crate) fn with_cameras() -> SplatAsset {
        let mut asset = fixture(20, 1);
        asset.near = 0.02;
        asset.capture_from_local.rotation = [0.5, -0.1, 0.7, 0.5];
        let camera = AssetCamera {
            name: "a.png".into(),
            width_px: 40,
            height_px: 30,
            focal_px: [35.0, 36.0],
            principal_px: [22.0, 14.0],
            rotation_rows: [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]],
            translation: [0.1, 0.2, 9.0],
            ..AssetCamera::default()
        };
        // Looks away.
        let rotation_rows = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        let away = AssetCamera {
            name: "b.png".into(),
            rotation_rows,
            translation: [0.0, 0.0, -50.0],
            ..camera.clone()
        };
        asset.cameras = vec![away, camera];
        asset
    }

    #[test]
    fn cameras_see_the_scene_where_it_was_seen() {
        let asset = with_cameras();
        let shown = ShownCamera::of(&asset, Cameras::All);
        assert_eq!(shown.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["a.png", "b.png"]);
        assert_eq!(ShownCamera::of(&asset, Cameras::Home), shown[..1]);
        let (frame, camera, shown) = (asset.world_from_local(), &asset.cameras[1], &shown[0]);
        for &p in &asset.positions {
            let [x, y, z] = frame.transform_point(p);
            let from_centre = [x - shown.centre[0], -y - shown.centre[1], -z - shown.centre[2]];
            let [x, y, z] = quaternion::turned(quaternion::conjugate(shown.rotation), from_centre);
            let at = [x / -z - shown.offset[0], y / -z - shown.offset[1]];
            let found = [40.0 * (0.5 + at[0] / shown.size[0]), 30.0 * (0.5 - at[1] / shown.size[1])];
            let row = |i: usize| {
                (0..3).map(|k| camera.rotation_rows[i][k] * f64::from(p[k])).sum::<f64>()
                    + camera.translation[i]
            };
            let expected = [35.0 * row(0) / row(2) + 22.0, 36.0 * row(1) / row(2) + 14.0];
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-5, "{found} {expected}"); // needed 2e-7: nine digits
            }
            // Negative control: the principal point in the middle.
            assert!((40.0 * (0.5 + (at[0] + shown.offset[0]) / shown.size[0]) - expected[0]).abs() > 1.0);
        }
        assert!((shown.near - 0.02 * 3.7).abs() < 1e-8);
    }

    #[test]
    fn cameras_without_an_image_are_left_out() {
        let mut asset = with_cameras();
        asset.cameras[0].width_px = 0;
        asset.cameras[1].focal_px[1] = f64::NAN;
        assert_eq!(ShownCamera::of(&asset, Cameras::All), []);
        asset.cameras.clear();
        assert_eq!(ShownCamera::of(&asset, Cameras::Home), []);
    }
}
