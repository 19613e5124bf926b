//! What the kernels know of a view.

use super::math::dot;
use crate::camera::Camera;
use crate::model::Model;

/// Camera, near plane and filter in f32.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewF32 {
    /// Rows of the rotation camera_from_local.
    pub rotation: [[f32; 3]; 3],
    pub translation: [f32; 3],
    pub centre_in_local: [f32; 3],
    pub focal_px: [f32; 2],
    pub principal_px: [f32; 2],
    pub size_px: [u32; 2],
    pub near: f32,
    /// Variance of the low-pass filter; 0: none.
    pub filter_px2: f32,
}

impl ViewF32 {
    pub(super) fn new(camera: &Camera, model: &Model) -> Self {
        let m = camera.camera_from_local.rotation;
        let row = |r: usize| [m.col(0)[r] as f32, m.col(1)[r] as f32, m.col(2)[r] as f32];
        let p = &camera.pinhole;
        Self {
            rotation: [row(0), row(1), row(2)],
            translation: camera.camera_from_local.translation.as_vec3().to_array(),
            centre_in_local: camera.centre_in_local().as_vec3().to_array(),
            focal_px: [p.fx_px as f32, p.fy_px as f32],
            principal_px: [p.cx_px as f32, p.cy_px as f32],
            size_px: [p.width_px, p.height_px],
            near: model.near,
            filter_px2: model.filter.variance_px2() as f32,
        }
    }

    /// Rotates a direction from the local frame into camera axes.
    pub(super) fn rotate(&self, v: [f32; 3]) -> [f32; 3] {
        self.rotation.map(|row| dot(row, v))
    }

    /// Inverse of [`ViewF32::rotate`].
    pub(super) fn rotate_back(&self, v: [f32; 3]) -> [f32; 3] {
        [0, 1, 2]
            .map(|k| self.rotation[0][k] * v[0] + self.rotation[1][k] * v[1] + self.rotation[2][k] * v[2])
    }
}
