//! Cameras on a circle around the point that the cameras of a capture look at.

use super::{Camera, RigidTransform};
use glam::{DMat3, DVec3};

/// `count` cameras on a circle. Its centre is the point nearest to all optical axes, its axis is `up`, a
/// unit vector of the local frame, its radius and height the cameras' medians; the lens is the first camera's. Empty without
/// cameras.
pub fn orbit(views: &[Camera], up: DVec3, count: u32) -> Vec<Camera> {
    let Some(first) = views.first() else { return Vec::new() };
    let target = nearest_to_axes(views);
    let offsets: Vec<DVec3> = views.iter().map(|c| c.centre_in_local() - target).collect();
    let height = median(offsets.iter().map(|o| o.dot(up)).collect());
    let across = |o: &DVec3| *o - up * o.dot(up);
    let radius = median(offsets.iter().map(|o| across(o).length()).collect()).max(1e-3);
    // The circle begins where the first camera stands.
    let east = across(&offsets[0]).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
    let north = up.cross(east);
    let at = |i: u32| {
        let angle = f64::from(i) / f64::from(count) * std::f64::consts::TAU;
        let centre = target + radius * (angle.cos() * east + angle.sin() * north) + height * up;
        Camera { pinhole: first.pinhole, camera_from_local: looking(centre, target, up) }
    };
    (0..count).map(at).collect()
}

/// `camera_from_local` of a camera at `centre` that looks at `target`.
pub fn looking(centre: DVec3, target: DVec3, up: DVec3) -> RigidTransform {
    let forward = (target - centre).try_normalize().unwrap_or(-up);
    let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
    let down = forward.cross(right);
    let rotation = DMat3::from_cols(right, down, forward).transpose();
    RigidTransform { rotation, translation: -(rotation * centre) }
}

/// The point with the least sum of squared distances to the optical axes; where they are all but
/// parallel, a point ahead of the cameras.
fn nearest_to_axes(views: &[Camera]) -> DVec3 {
    let mut normal = DMat3::ZERO;
    let mut right_side = DVec3::ZERO;
    let mut centre = DVec3::ZERO;
    let mut forward = DVec3::ZERO;
    for camera in views {
        let axis = camera.camera_from_local.rotation.row(2);
        let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        let across = DMat3::IDENTITY - outer;
        normal += across;
        right_side += across * camera.centre_in_local();
        centre += camera.centre_in_local();
        forward += axis;
    }
    let n = views.len() as f64;
    let point = normal.inverse() * right_side;
    if (normal * (1.0 / n)).determinant() > 1e-6 && point.is_finite() {
        return point;
    }
    // The cameras' extent is 1 in the local frame.
    centre / n + forward.try_normalize().unwrap_or(DVec3::Z)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Pinhole;

    const LENS: Pinhole =
        Pinhole { width_px: 40, height_px: 30, fx_px: 30.0, fy_px: 30.0, cx_px: 20.0, cy_px: 15.0 };

    fn ring(target: DVec3, up: DVec3) -> Vec<Camera> {
        let east = up.any_orthonormal_vector();
        let north = up.cross(east);
        let at = |i: usize| {
            let a = i as f64 / 7.0 * std::f64::consts::TAU;
            let centre = target + 2.0 * (a.cos() * east + a.sin() * north) + 0.5 * up;
            Camera { pinhole: LENS, camera_from_local: looking(centre, target, up) }
        };
        (0..7).map(at).collect()
    }

    #[test]
    fn an_orbit_of_cameras_on_a_ring_follows_the_ring() {
        let target = DVec3::new(1.0, -2.0, 3.0);
        let up = DVec3::new(0.1, -0.9, 0.2).normalize();
        let given = ring(target, up);
        let orbit = orbit(&given, up, 12);
        assert_eq!(orbit.len(), 12);
        assert!(orbit[0].centre_in_local().distance(given[0].centre_in_local()) < 1e-9);
        for camera in &orbit {
            let offset = camera.centre_in_local() - target;
            assert!((offset.dot(up) - 0.5).abs() < 1e-9);
            assert!((offset.length_squared() - 4.25).abs() < 1e-9);
            let seen = camera.camera_from_local.transform_point(target);
            assert!(LENS.project(seen).unwrap().distance(glam::DVec2::new(20.0, 15.0)) < 1e-9);
            assert!((camera.camera_from_local.rotation.determinant() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn an_orbit_of_parallel_cameras_is_finite_and_without_cameras_empty() {
        let camera = Camera { pinhole: LENS, camera_from_local: RigidTransform::IDENTITY };
        for c in orbit(&[camera, camera], DVec3::NEG_Y, 3) {
            assert!(c.camera_from_local.translation.is_finite());
            assert!(c.camera_from_local.rotation.is_finite());
        }
        assert!(orbit(&[], DVec3::NEG_Y, 3).is_empty());
    }
}
