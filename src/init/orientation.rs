//! Orientations of initial splats: each faces the nearest camera that shows it (method 5.6).

use super::input::InitInput;
use super::points::LocalPoint;
use crate::camera::Camera;
use glam::{DQuat, DVec3};
use rayon::prelude::*;

/// Turns splats by the least angle until they face the nearest camera that shows them, either side up. Their random rotation remains
/// about that direction, and a capture that is turned starts alike.
pub(super) fn face_cameras(points: &mut [LocalPoint], input: &InitInput<'_>) {
    let cameras: Vec<Camera> = input.photo_views().into_iter().map(|view| input.views.camera(view)).collect();
    points.par_iter_mut().for_each(|point| {
        if let Some(direction) = to_nearest(&cameras, point.position_in_local()) {
            point.quaternion = tilted(point.quaternion, direction);
        }
    });
}

/// The direction of the nearest camera that shows a place.
fn to_nearest(cameras: &[Camera], at: DVec3) -> Option<DVec3> {
    let offsets =
        cameras.iter().filter(|camera| camera.shows(at)).map(|camera| camera.centre_in_local() - at);
    let nearest = offsets.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    nearest.and_then(DVec3::try_normalize)
}

/// local_from_surfel, wxyz, turned by the least angle after which its normal is this one or the opposite.
fn tilted([w, x, y, z]: [f32; 4], normal: DVec3) -> [f32; 4] {
    let drawn = DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into()).normalize();
    let own = drawn * DVec3::Z;
    let tilt = DQuat::from_rotation_arc(own, if own.dot(normal) < 0.0 { -normal } else { normal });
    let [x, y, z, w] = (tilt * drawn).normalize().to_array();
    [w, x, y, z].map(|v| v as f32)
}
