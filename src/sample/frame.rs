//! The frame in which the sparse model of a sample capture is written.

use super::options::SampleOptions;
use super::poses::from_centre_and_rotation;
use super::stress::StressKind as Kind;
use crate::camera::RigidTransform;
use glam::{DMat3, DVec3};

/// A similarity: `scale * rotation * in_scene + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    scale: f64,
    rotation: DMat3,
    translation: DVec3,
}

impl Frame {
    /// The frame that the stress asks for; else that of the scene.
    pub fn new(options: &SampleOptions) -> Self {
        let level = |kind| options.stress.and_then(|s| s.level_of(kind));
        let axis = DVec3::new(1.0, 2.0, 3.0).normalize();
        let turn = level(Kind::Turn).unwrap_or(0.0).to_radians();
        Self {
            scale: level(Kind::Scale).unwrap_or(1.0),
            rotation: if turn == 0.0 { DMat3::IDENTITY } else { DMat3::from_axis_angle(axis, turn) },
            translation: level(Kind::Offset).unwrap_or(0.0) * DVec3::new(1.0, -0.5, 0.25),
        }
    }

    /// Maps a point of the scene.
    pub fn point(&self, in_scene: DVec3) -> DVec3 {
        self.scale * (self.rotation * in_scene) + self.translation
    }

    /// Maps a pose.
    pub fn pose(&self, camera_from_scene: &RigidTransform) -> RigidTransform {
        let is_identity =
            self.scale == 1.0 && self.rotation == DMat3::IDENTITY && self.translation == DVec3::ZERO;
        if is_identity {
            // Without the rounding of the centre.
            return *camera_from_scene;
        }
        let rotation = camera_from_scene.rotation * self.rotation.transpose();
        from_centre_and_rotation(self.point(camera_from_scene.origin_of_a_in_b()), rotation)
    }
}
