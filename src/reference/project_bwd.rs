//! Backward projection: applies the chain rule from a splat's projected quantities to its stored parameters (method
//! 2.4, "per splat, once").

use super::raster_bwd::ScreenGradient;
use super::{Params, Projected, Settings, sh_basis, sh_basis_derivative};
use crate::camera::Camera;
use crate::constants::sh_coefficients;
use glam::{DMat2, DMat3, DVec2, DVec3};

/// Adds the gradient of splat `i` to `grad`.
pub(super) fn project_bwd(
    params: &Params,
    i: usize,
    projected: &Projected,
    screen: &ScreenGradient,
    camera: &Camera,
    settings: &Settings,
    grad: &mut Params,
) {
    let screen = &filter_bwd(projected, screen, settings);
    let (by_centre, by_axes) = map_bwd(projected, screen, camera);
    let local_from_camera = camera.camera_from_local.rotation.transpose();
    let by_position =
        local_from_camera * by_centre + sh_bwd(params, i, projected, screen, camera, settings, grad);
    let by_rotation = DMat3::from_cols(
        local_from_camera * by_axes[0],
        local_from_camera * by_axes[1],
        local_from_camera * by_axes[2],
    );
    let by_quaternion = quaternion_bwd(params.quaternion(i), by_rotation);
    (0..3).for_each(|k| grad.splats.positions[3 * i + k] += by_position[k]);
    (0..4).for_each(|k| grad.splats.quaternions[4 * i + k] += by_quaternion[k]);
    (0..2).for_each(|k| grad.splats.log_scales[2 * i + k] += screen.log_scales[k]);
    grad.splats.opacity_logits[i] += screen.opacity * projected.opacity * (1.0 - projected.stored_opacity);
}

/// Adds what the low-pass filter passes on: its covariance on the surfel follows from the projective map at the centre and
/// from the standard deviations, and the opacity is divided by the root of the spread's determinant.
fn filter_bwd(p: &Projected, screen: &ScreenGradient, settings: &Settings) -> ScreenGradient {
    let [by_u, by_v] = screen.spread;
    let by_spread = DMat2::from_cols(by_u, by_v) - 0.5 * screen.opacity * p.opacity * p.spread.inverse();
    let sigma_from_px = p.sigma_from_px();
    let by_map = 2.0 * settings.filter_px2 * (by_spread * sigma_from_px);
    let mut out = screen.clone();
    for (k, by_numerator) in [&mut out.a, &mut out.b].into_iter().enumerate() {
        *by_numerator += by_map.row(k) / p.scales[k];
        out.log_scales[k] -= by_map.row(k).dot(sigma_from_px.row(k));
    }
    out
}

/// Derivatives with respect to the centre and the three axes, all in camera axes.
fn map_bwd(p: &Projected, screen: &ScreenGradient, camera: &Camera) -> (DVec3, [DVec3; 3]) {
    let (fx, fy) = (camera.pinhole.fx_px, camera.pinhole.fy_px);
    let pc = p.centre_in_camera;
    let [e_u, e_v, n] = p.axes_in_camera;
    let w0 = pc.dot(n) / pc.z;
    let to_numerator = |v: DVec2| DVec3::new(v.x / fx, v.y / fy, 0.0) / w0;
    let by_cross_a = to_numerator(screen.a);
    let by_cross_b = to_numerator(screen.b);
    let by_w0 = -(screen.a.dot(p.a) + screen.b.dot(p.b) + screen.g.dot(p.g)) / w0;
    let by_n = to_numerator(screen.g) + by_w0 * pc / pc.z + screen.normal;
    let by_projection = DVec3::new(
        screen.centre_px.x * fx / pc.z,
        screen.centre_px.y * fy / pc.z,
        -(screen.centre_px.x * fx * pc.x + screen.centre_px.y * fy * pc.y) / (pc.z * pc.z),
    );
    let by_centre = by_cross_a.cross(e_v)
        + e_u.cross(by_cross_b)
        + by_w0 * (n / pc.z - DVec3::new(0.0, 0.0, w0 / pc.z))
        + by_projection
        + DVec3::new(0.0, 0.0, screen.depth);
    (by_centre, [by_cross_b.cross(pc), pc.cross(by_cross_a), by_n])
}

/// Adds the SH gradient to `grad` and returns the derivative with respect to the position through the view direction.
fn sh_bwd(
    params: &Params,
    i: usize,
    projected: &Projected,
    screen: &ScreenGradient,
    camera: &Camera,
    settings: &Settings,
    grad: &mut Params,
) -> DVec3 {
    let by_rgb = DVec3::from_array(
        [0, 1, 2].map(|c| if projected.unclamped_rgb[c] > 0.0 { screen.base_rgb[c] } else { 0.0 }),
    );
    let offset = params.position(i) - camera.centre_in_local();
    let direction = offset.normalize();
    let degree = settings.sh_degree.min(params.splats.sh_degrees()[i].into());
    let basis = sh_basis(degree, direction);
    let slopes = sh_basis_derivative(degree, direction);
    let mut by_direction = DVec3::ZERO;
    for k in 0..sh_coefficients(degree) {
        let first = params.splats.sh_offsets()[i] as usize + 3 * k;
        (0..3).for_each(|c| grad.splats.sh[first + c] += basis[k] * by_rgb[c]);
        by_direction += slopes[k] * DVec3::from_slice(&params.splats.sh[first..]).dot(by_rgb);
    }
    (by_direction - direction * direction.dot(by_direction)) / offset.length()
}

/// Derivative w.r.t. a stored quaternion (wxyz) from the derivative w.r.t. the entries of its rotation matrix.
fn quaternion_bwd(stored: [f64; 4], by_rotation: DMat3) -> [f64; 4] {
    let norm = stored.iter().map(|q| q * q).sum::<f64>().sqrt();
    let [w, x, y, z] = stored.map(|q| q / norm);
    let m = |row: usize, col: usize| by_rotation.col(col)[row];
    let by_unit = [
        2.0 * (-z * m(0, 1) + y * m(0, 2) + z * m(1, 0) - x * m(1, 2) - y * m(2, 0) + x * m(2, 1)),
        2.0 * (y * m(0, 1) + z * m(0, 2) + y * m(1, 0) - 2.0 * x * m(1, 1) - w * m(1, 2)
            + z * m(2, 0)
            + w * m(2, 1)
            - 2.0 * x * m(2, 2)),
        2.0 * (-2.0 * y * m(0, 0) + x * m(0, 1) + w * m(0, 2) + x * m(1, 0) + z * m(1, 2) - w * m(2, 0)
            + z * m(2, 1)
            - 2.0 * y * m(2, 2)),
        2.0 * (-2.0 * z * m(0, 0) - w * m(0, 1) + x * m(0, 2) + w * m(1, 0) - 2.0 * z * m(1, 1)
            + y * m(1, 2)
            + x * m(2, 0)
            + y * m(2, 1)),
    ];
    let unit = [w, x, y, z];
    let along: f64 = unit.iter().zip(&by_unit).map(|(q, d)| q * d).sum();
    [0, 1, 2, 3].map(|k| (by_unit[k] - unit[k] * along) / norm)
}
