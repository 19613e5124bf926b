//! Transforms between the frames of an asset: local (in which its numbers are), of the capture, and of files (the world).

use crate::math::quaternion;
use crate::math::quaternion::QUATERNION_NORM_TOLERANCE;
use serde::{Deserialize, Serialize};

/// A similarity from one frame to another, such as `in_capture = scale * rotation(in_local) + translation`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Length of a unit of the first frame in the second; positive.
    pub scale: f64,
    /// Unit quaternion **wxyz**; the trainer's frames are not turned.
    pub rotation: [f64; 4],
    /// Origin of the first frame in the second.
    pub translation: [f64; 3],
}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Transform {
    /// Maps every point to itself.
    pub const IDENTITY: Self = Self::scaled_and_moved(1.0, [0.0; 3]);

    /// A scaling and a translation, without a rotation.
    pub const fn scaled_and_moved(scale: f64, translation: [f64; 3]) -> Self {
        Self { scale, rotation: [1.0, 0.0, 0.0, 0.0], translation }
    }

    /// Whether this is exactly the identity.
    pub fn is_identity(&self) -> bool {
        *self == Self::IDENTITY
    }

    /// First `first`, then this transform. Exact if either is the identity.
    pub fn after(&self, first: &Self) -> Self {
        if first.is_identity() || self.is_identity() {
            return if first.is_identity() { *self } else { *first };
        }
        let turned = quaternion::turned(self.rotation, first.translation);
        let rotation = quaternion::product(self.rotation, first.rotation);
        let norm = quaternion::norm(rotation);
        Self {
            scale: self.scale * first.scale,
            // No negative zeros, so that equal transforms make equal files.
            rotation: rotation.map(|v| v / norm + 0.0),
            translation: std::array::from_fn(|i| self.scale * turned[i] + self.translation[i] + 0.0),
        }
    }

    /// The transform from the second frame to the first.
    pub fn inverse(&self) -> Self {
        let back = quaternion::conjugate(self.rotation);
        let turned = quaternion::turned(back, self.translation);
        let rotation = back.map(|v| v + 0.0);
        Self { scale: 1.0 / self.scale, rotation, translation: turned.map(|t| 0.0 - t / self.scale) }
    }

    /// Whether all numbers are finite, the scale is positive and the rotation a unit quaternion.
    pub fn is_sound(&self) -> bool {
        self.scale.is_finite()
            && self.scale > 0.0
            && (quaternion::norm(self.rotation) - 1.0).abs() <= QUATERNION_NORM_TOLERANCE
            && self.translation.iter().all(|v| v.is_finite())
    }

    /// Whether the rotation is exactly the identity.
    pub fn is_upright(&self) -> bool {
        self.rotation == Self::IDENTITY.rotation
    }

    /// Maps a point of the first frame to the second.
    pub fn transform_point(&self, in_local: [f32; 3]) -> [f64; 3] {
        let mut p = in_local.map(f64::from);
        if !self.is_upright() {
            p = quaternion::turned(self.rotation, p);
        }
        std::array::from_fn(|i| self.scale * p[i] + self.translation[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_compose_and_invert() {
        let a = Transform { scale: 2.5, rotation: [0.5, -0.5, 0.5, 0.5], translation: [1.0, -2.0, 3.0] };
        let b = Transform { scale: 0.01, rotation: [0.6, 0.0, 0.8, 0.0], translation: [-7.0, 0.5, 0.0] };
        let p = [0.3_f32, -4.0, 11.0];
        let one_by_one = a.transform_point(b.transform_point(p).map(|v| v as f32));
        let at_once = a.after(&b).transform_point(p);
        let back = b.inverse().after(&a.inverse()).after(&a.after(&b)).transform_point(p);
        for i in 0..3 {
            assert!((one_by_one[i] - at_once[i]).abs() < 1e-6, "{one_by_one:?} {at_once:?}"); // f32 between: needed 3e-7
            assert!((back[i] - f64::from(p[i])).abs() < 1e-12, "{back:?}"); // needed 2e-14
        }
        assert_eq!(a.after(&Transform::IDENTITY), a);
        assert_eq!(Transform::IDENTITY.after(&b), b);
        assert!(a.is_sound() && !Transform { scale: 0.0, ..a }.is_sound());
        assert!(!Transform { rotation: [0.5; 4].map(|v| 1.1 * v), ..a }.is_sound());
    }
}
