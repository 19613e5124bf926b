//! Poses of cameras as other programs state them: axes and centre of the camera in the capture.

use crate::camera::RigidTransform;
use crate::capture::source::checked_pose;
use glam::{DMat3, DVec3};

/// A matrix from its rows.
pub(crate) fn from_rows(rows: [[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&rows).transpose()
}

/// `camera_from_capture` of a camera with x to the right, y up and z backward (OpenGL, ARKit); the columns of the
/// matrix are its axes.
///
/// # Errors
/// What is wrong with the pose.
pub(crate) fn from_opengl(axes: DMat3, centre: DVec3) -> Result<RigidTransform, String> {
    from_opencv(DMat3::from_cols(axes.x_axis, -axes.y_axis, -axes.z_axis), centre)
}

/// The same with x to the right, y down and z forward (OpenCV).
///
/// # Errors
/// What is wrong with the pose.
pub(crate) fn from_opencv(axes: DMat3, centre: DVec3) -> Result<RigidTransform, String> {
    Ok(checked_pose(axes, centre)?.inverse())
}
