//! Cameras as metadata hold them: exactly, or with as few digits as their images need.

use crate::AssetCamera;
use crate::math::quaternion;
use crate::number::to_decimals;
use serde::{Deserialize, Serialize};

/// By how many pixels short numbers may move the image of a point beyond the near plane: those of the lens, of the rotation and
/// of the translation, 0.05 together. Mean reprojection errors of captures are ten times that (measured: 0.46 to 0.91 pixels).
const LENS_PX: f64 = 0.01;
const ROTATION_PX: f64 = 0.02;
const TRANSLATION_PX: f64 = 0.02;

/// A matrix is kept if an element differs by more than this from that of the nearest quaternion's: 0.002 pixels at a focal length
/// of 2,000.
const ROTATION_TOLERANCE: f64 = 1e-6;

/// A camera; the names of its fields are part of the formats.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct MetaCamera {
    pub name: String,
    #[serde(default)]
    pub held_out: bool,
    pub width_px: u32,
    pub height_px: u32,
    pub focal_px: [f64; 2],
    pub principal_px: [f64; 2],
    #[serde(flatten)]
    pub rotation: Rotation,
    pub translation: [f64; 3],
}

/// The rotation of `camera_from_local`, in one of two forms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Rotation {
    /// Its rows.
    RotationRows([[f64; 3]; 3]),
    /// A quaternion wxyz of any length but 0; with 0, the rows are not finite, and validation refuses them.
    #[serde(rename = "rotation")]
    Quaternion([f64; 4]),
}

impl Rotation {
    fn rows(self) -> [[f64; 3]; 3] {
        match self {
            Self::RotationRows(rows) => rows,
            Self::Quaternion(q) => quaternion::rows(q),
        }
    }
}

impl MetaCamera {
    /// The camera with all digits.
    pub fn exact(camera: &AssetCamera) -> Self {
        Self {
            name: camera.name.clone(),
            held_out: camera.held_out,
            width_px: camera.width_px,
            height_px: camera.height_px,
            focal_px: camera.focal_px,
            principal_px: camera.principal_px,
            rotation: Rotation::RotationRows(camera.rotation_rows),
            translation: camera.translation,
        }
    }

    /// The camera with so few digits that the image of no point beyond the near plane moves by more than 0.05 pixels. `near` in
    /// local units.
    pub fn short(camera: &AssetCamera, near: f32) -> Self {
        Self::within(camera, near, 1.0)
    }

    /// [`Self::short`] for a multiple of these 0.05 pixels.
    fn within(camera: &AssetCamera, near: f32, factor: f64) -> Self {
        let mut short = Self::exact(camera);
        // The largest tangent of an angle between the axis and a ray of the image.
        let size = [camera.width_px, camera.height_px].map(f64::from);
        let reach = |i: usize| {
            let [c, f] = [camera.principal_px[i], camera.focal_px[i]];
            c.abs().max((size[i] - c).abs()) / f.abs()
        };
        let tangent = reach(0).hypot(reach(1));
        let focal = camera.focal_px[0].abs().max(camera.focal_px[1].abs());
        // Rounding moves a number by at most half a step: two focal lengths and two coordinates of the principal point; three numbers
        // of the quaternion, of which an angle is twice as large; three of the translation.
        let lens = factor * LENS_PX / (0.5 * (2_f64.sqrt() + tangent));
        let rotation = factor * ROTATION_PX / (3_f64.sqrt() * focal * (1.0 + tangent * tangent));
        let translation = factor * TRANSLATION_PX * f64::from(near)
            / (0.5 * 3_f64.sqrt() * focal * (1.0 + tangent * tangent).sqrt());
        let round = |numbers: &mut [f64], step: f64| {
            numbers.iter_mut().for_each(|number| *number = to_decimals(*number, step));
        };
        round(&mut short.focal_px, lens);
        round(&mut short.principal_px, lens);
        let rows = camera.rotation_rows;
        let q = quaternion::from_axes([0, 1, 2].map(|axis| rows.map(|row| row[axis])));
        // The largest number becomes 1, and has no digits to be rounded.
        let largest = q.into_iter().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        let mut q = q.map(|v| v / largest);
        let off = quaternion::rows(q).into_iter().flatten().zip(rows.into_iter().flatten());
        if off.map(|(a, b)| (a - b).abs()).all(|off| off < ROTATION_TOLERANCE) {
            round(&mut q, rotation);
            short.rotation = Rotation::Quaternion(q);
            // The camera stays where it is: its centre in the local frame is the negative of this.
            let place: [f64; 3] = [0, 1, 2].map(|k| (0..3).map(|i| rows[i][k] * camera.translation[i]).sum());
            short.translation = quaternion::rows(q).map(|row| (0..3).map(|k| row[k] * place[k]).sum());
        }
        round(&mut short.translation, translation);
        short
    }
}

impl From<MetaCamera> for AssetCamera {
    fn from(camera: MetaCamera) -> Self {
        let MetaCamera { name, held_out, width_px, height_px, focal_px, principal_px, rotation, translation } =
            camera;
        let rotation_rows = rotation.rows();
        Self { name, held_out, width_px, height_px, focal_px, principal_px, rotation_rows, translation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::{camera, random};

    /// Largest distance in pixels between the images of points of the near plane, in the corners of the image and within it.
    fn moved_px(exact: &AssetCamera, short: &AssetCamera, near: f64) -> f64 {
        let mut worst = 0.0_f64;
        for corner in 0..25 {
            let share = [corner % 5, corner / 5].map(|k| f64::from(k) / 4.0);
            let at = [share[0] * f64::from(exact.width_px), share[1] * f64::from(exact.height_px)];
            let ray = |i: usize| (at[i] - exact.principal_px[i]) / exact.focal_px[i];
            let in_camera = [ray(0) * near, ray(1) * near, near];
            let moved: [f64; 3] = std::array::from_fn(|i| in_camera[i] - exact.translation[i]);
            let point: [f64; 3] =
                std::array::from_fn(|k| (0..3).map(|i| exact.rotation_rows[i][k] * moved[i]).sum());
            let seen: [f64; 3] = std::array::from_fn(|i| {
                let along: f64 = (0..3).map(|k| short.rotation_rows[i][k] * point[k]).sum();
                along + short.translation[i]
            });
            let image = |i: usize| short.focal_px[i] * seen[i] / seen[2] + short.principal_px[i];
            worst = worst.max((image(0) - at[0]).hypot(image(1) - at[1]));
        }
        worst
    }

    /// Cameras with any rotation, lens and place.
    fn cameras() -> Vec<(AssetCamera, f32)> {
        let mut random = random(7);
        let mut unit = move || random(1 << 20) as f64 / f64::from(1 << 20);
        let mut any = || {
            let q = [unit(), unit(), unit(), unit()].map(|v| 2.0 * v - 1.0);
            let [width_px, height_px] = [unit(), unit()].map(|v| (90.0 + 4000.0 * v * v * v) as u32);
            let focal = f64::from(width_px) * (0.4 + 2.0 * unit());
            let extent = 20.0_f64.powf(6.0 * unit() - 2.0);
            let camera = AssetCamera {
                width_px,
                height_px,
                focal_px: [focal, focal * (0.9 + 0.2 * unit())],
                principal_px: [width_px, height_px].map(|side| f64::from(side) * (0.3 + 0.4 * unit())),
                rotation_rows: quaternion::rows(q),
                translation: [unit(), unit(), unit()].map(|v| extent * (v - 0.5)),
                ..AssetCamera::default()
            };
            (camera, (0.04 * extent * unit()).max(1e-5) as f32)
        };
        (0..2000).map(|_| any()).collect()
    }

    #[test]
    fn short_numbers_move_no_image_by_more_than_a_twentieth_of_a_pixel() {
        let worst = |factor: f64| {
            let moved = cameras().into_iter().map(|(camera, near)| {
                let short = MetaCamera::within(&camera, near, factor);
                assert!(matches!(short.rotation, Rotation::Quaternion(_)));
                moved_px(&camera, &short.into(), near.into())
            });
            moved.fold(0.0, f64::max)
        };
        let found = worst(1.0);
        assert!(found < 0.05 && found > 0.01, "{found}"); // needed 0.021
        // Negative control: a digit less moves some by more.
        assert!(worst(10.0) > 0.05);
    }

    #[test]
    fn a_second_time_changes_nothing() {
        for (camera, near) in cameras() {
            let once: AssetCamera = MetaCamera::short(&camera, near).into();
            assert_eq!(AssetCamera::from(MetaCamera::short(&once, near)), once);
            assert_ne!(once, camera, "negative control");
        }
    }

    #[test]
    fn cameras_are_read_in_both_forms() {
        let exact = MetaCamera::exact(&camera());
        let short = MetaCamera::short(&camera(), 0.04);
        for (form, name, other) in
            [(&exact, "\"rotationRows\":[[", "\"rotation\":"), (&short, "\"rotation\":[1.0,0.5,", "Rows")]
        {
            let text = serde_json::to_string(form).unwrap();
            assert!(text.contains(name) && !text.contains(other), "{text}");
            assert_eq!(&serde_json::from_str::<MetaCamera>(&text).unwrap(), form);
        }
        let text = serde_json::to_string(&exact).unwrap().replace("rotationRows", "rows");
        assert!(serde_json::from_str::<MetaCamera>(&text).is_err(), "no rotation");
    }

    #[test]
    fn what_is_no_rotation_or_has_no_image_is_kept() {
        let mirrored =
            AssetCamera { rotation_rows: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], ..camera() };
        let none = AssetCamera { rotation_rows: [[0.0; 3]; 3], ..camera() };
        for camera in [&mirrored, &none] {
            let short = MetaCamera::short(camera, 0.04);
            assert_eq!(short.rotation, Rotation::RotationRows(camera.rotation_rows));
        }
        let third = [1.0 / 3.0, 2e-9 / 3.0, 1e6 / 7.0];
        let blind = AssetCamera { focal_px: [0.0; 2], translation: third, ..AssetCamera::default() };
        let short = MetaCamera::short(&blind, 0.0);
        assert_eq!((short.translation, short.focal_px), (third, [0.0; 2]));
        let short = MetaCamera::short(&AssetCamera { translation: third, ..camera() }, 0.04);
        assert_ne!(short.translation, third, "negative control");
    }
}
