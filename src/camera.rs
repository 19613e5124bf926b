//! Pinhole cameras and the transforms between frames, in f64.
//!
//! Camera axes follow COLMAP and OpenCV: x right, y down, z forward. A pixel's centre lies at its
//! integer index + 0.5. There is no lens distortion here; `capture` removes it on load.

mod level;
pub mod orbit;
mod symmetric;
pub mod up;
/// The mean of cameras' centres, and the largest distance of one from it; 0 without any.
pub fn mean_and_reach(centres: &[DVec3]) -> (DVec3, f64) {
    let mean = centres.iter().sum::<DVec3>() / centres.len().max(1) as f64;
    (mean, centres.iter().map(|centre| centre.distance(mean)).fold(0.0, f64::max))
}

#[cfg(test)]
mod up_tests;

use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Pinhole intrinsics for a given image size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pinhole {
    /// Image width.
    pub width_px: u32,
    /// Image height.
    pub height_px: u32,
    /// Focal length along x.
    pub fx_px: f64,
    /// Focal length along y.
    pub fy_px: f64,
    /// Principal point x, measured from the left edge of the leftmost pixel.
    pub cx_px: f64,
    /// Principal point y, measured from the upper edge of the uppermost pixel.
    pub cy_px: f64,
}

impl Pinhole {
    /// The same camera for an image resized to `width_px` x `height_px`, with the same field of view.
    pub fn resized(&self, width_px: u32, height_px: u32) -> Self {
        let sx = f64::from(width_px) / f64::from(self.width_px);
        let sy = f64::from(height_px) / f64::from(self.height_px);
        Self {
            width_px,
            height_px,
            fx_px: self.fx_px * sx,
            fy_px: self.fy_px * sy,
            cx_px: self.cx_px * sx,
            cy_px: self.cy_px * sy,
        }
    }

    /// Projects a point in camera coordinates to pixels; `None` at or behind the camera plane.
    pub fn project(&self, in_camera: DVec3) -> Option<DVec2> {
        (in_camera.z > 0.0).then(|| {
            DVec2::new(
                self.fx_px * in_camera.x / in_camera.z + self.cx_px,
                self.fy_px * in_camera.y / in_camera.z + self.cy_px,
            )
        })
    }

    /// Direction of the ray through an image position, in camera coordinates with z = 1.
    pub fn direction_in_camera(&self, position_px: DVec2) -> DVec3 {
        DVec3::new((position_px.x - self.cx_px) / self.fx_px, (position_px.y - self.cy_px) / self.fy_px, 1.0)
    }

    /// Pixels of the image, width times height.
    pub fn num_pixels(&self) -> usize {
        self.width_px as usize * self.height_px as usize
    }
}

/// A rotation and a translation: `in_a = rotation * in_b + translation` for `a_from_b`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigidTransform {
    /// Orthonormal, with determinant +1.
    pub rotation: DMat3,
    /// Origin of frame b in frame a.
    pub translation: DVec3,
}

impl RigidTransform {
    /// The transform that changes nothing.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// Maps a point of frame b to frame a.
    pub fn transform_point(&self, in_b: DVec3) -> DVec3 {
        self.rotation * in_b + self.translation
    }

    /// The inverse transform, `b_from_a`.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// Origin of frame a in frame b. For `camera_from_local` this is the camera's centre.
    pub fn origin_of_a_in_b(&self) -> DVec3 {
        -(self.rotation.transpose() * self.translation)
    }
}

/// Uniform scale and translation: `in_a = scale * in_b + translation` for `a_from_b`.
///
/// The `capture_from_local` of a model is one: training happens in a local frame in which the capture's extent
/// is 1, and every file stores the transform back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Similarity {
    /// Length of one unit of frame b in frame a, greater than 0.
    pub scale: f64,
    /// Origin of frame b in frame a.
    pub translation: DVec3,
}

impl Similarity {
    /// The transform that changes nothing.
    pub const IDENTITY: Self = Self { scale: 1.0, translation: DVec3::ZERO };

    /// Maps a point of frame b to frame a.
    pub fn transform_point(&self, in_b: DVec3) -> DVec3 {
        self.scale * in_b + self.translation
    }

    /// The inverse transform, `b_from_a`.
    pub fn inverse(&self) -> Self {
        Self { scale: 1.0 / self.scale, translation: -self.translation / self.scale }
    }

    /// `camera_from_b` for a camera with a pose in frame a. Camera space is rescaled to the units of frame b.
    pub fn rebase_camera(&self, camera_from_a: &RigidTransform) -> RigidTransform {
        let translation =
            (camera_from_a.rotation * self.translation + camera_from_a.translation) / self.scale;
        RigidTransform { rotation: camera_from_a.rotation, translation }
    }
}

/// A camera posed in the local frame: all that a renderer needs of a view.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Intrinsics at the rendered size.
    pub pinhole: Pinhole,
    /// Pose in the local frame.
    pub camera_from_local: RigidTransform,
}

impl Camera {
    /// The camera's centre in the local frame.
    pub fn centre_in_local(&self) -> DVec3 {
        self.camera_from_local.origin_of_a_in_b()
    }

    /// Whether a point of the local frame lies within the image.
    pub fn shows(&self, point: DVec3) -> bool {
        let [w, h] = [self.pinhole.width_px, self.pinhole.height_px].map(f64::from);
        let at = self.pinhole.project(self.camera_from_local.transform_point(point));
        at.is_some_and(|at| at.x >= 0.0 && at.y >= 0.0 && at.x <= w && at.y <= h)
    }

    /// The same camera at another image size.
    pub fn resized(&self, width_px: u32, height_px: u32) -> Self {
        Self { pinhole: self.pinhole.resized(width_px, height_px), ..*self }
    }

    /// The same camera at the size whose longer side is this.
    pub fn with_longer_side(&self, longer_side_px: u32) -> Self {
        let Pinhole { width_px, height_px, .. } = self.pinhole;
        let longer = f64::from(width_px.max(height_px));
        let side = |s: u32| (f64::from(s) * f64::from(longer_side_px) / longer).round().max(1.0) as u32;
        self.resized(side(width_px), side(height_px))
    }
}
