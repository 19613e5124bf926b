//! Pixel bounds of a splat: the exact box of the conic that the disc of alpha >= 1/255 projects to, or where the
//! conic is not an ellipse, the box of the disc's bounding quad clipped at the near plane (method 2.3).

use super::project::Projected;
use crate::camera::Camera;
use crate::constants::{ALPHA_MIN, CONIC_MARGIN};
use glam::{DVec2, DVec3};

/// Half-open ranges of the pixels whose centres lie within the bounds, clipped to the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelBounds {
    /// First column.
    pub x0: u32,
    /// One past the last column.
    pub x1: u32,
    /// First row.
    pub y0: u32,
    /// One past the last row.
    pub y1: u32,
}

/// Squared radius, in standard deviations, at which alpha falls to 1/255.
fn support_radius_squared(opacity: f64) -> f64 {
    2.0 * (opacity / ALPHA_MIN).ln()
}

/// Bounds of a splat; `None` where no pixel centre lies within.
pub fn pixel_bounds(p: &Projected, camera: &Camera, near: f64) -> Option<PixelBounds> {
    let r2 = support_radius_squared(p.opacity);
    if r2 < 0.0 {
        return None;
    }
    let half_axes = widened_axes(p);
    let (low, high) =
        conic_box(p, half_axes, camera, r2).or_else(|| clipped_box(p, half_axes, camera, r2.sqrt(), near))?;
    let (width, height) = (f64::from(camera.pinhole.width_px), f64::from(camera.pinhole.height_px));
    // Pixel x has its centre at x + 0.5.
    let first = |v: f64, size: f64| (v - 0.5).ceil().clamp(0.0, size) as u32;
    let past = |v: f64, size: f64| ((v - 0.5).floor() + 1.0).clamp(0.0, size) as u32;
    let bounds = PixelBounds {
        x0: first(low.x, width),
        x1: past(high.x, width),
        y0: first(low.y, height),
        y1: past(high.y, height),
    };
    (bounds.x0 < bounds.x1 && bounds.y0 < bounds.y1).then_some(bounds)
}

/// Two half axes of the ellipse on which the falloff is that of a standard deviation, in camera axes: conjugate, not
/// orthogonal.
fn widened_axes(p: &Projected) -> [DVec3; 2] {
    let spread = p.spread;
    let along = spread.x_axis.x.sqrt();
    let shear = spread.x_axis.y / along;
    let across = (spread.determinant() / spread.x_axis.x).sqrt();
    let [u, v] = [0, 1].map(|k| p.axes_in_camera[k] * p.scales[k]);
    [u * along + v * shear, v * across]
}

/// Box of the projected disc, from the rows of its homography relative to the projected centre; `None` if the disc
/// reaches the camera plane, where the conic is not an ellipse.
fn conic_box(p: &Projected, half_axes: [DVec3; 2], camera: &Camera, r2: f64) -> Option<(DVec2, DVec2)> {
    let pc = p.centre_in_camera;
    let row = |e: DVec3| {
        let tu = camera.pinhole.fx_px * (e.x - pc.x / pc.z * e.z);
        let tv = camera.pinhole.fy_px * (e.y - pc.y / pc.z * e.z);
        (DVec2::new(tu, tv), e.z)
    };
    let ((t0, w0), (t1, w1)) = (row(half_axes[0]), row(half_axes[1]));
    let denominator = r2 * (w0 * w0 + w1 * w1) - pc.z * pc.z;
    if denominator > -CONIC_MARGIN * pc.z * pc.z {
        return None;
    }
    let centre = (t0 * w0 + t1 * w1) * (r2 / denominator);
    let half2 = centre * centre - (t0 * t0 + t1 * t1) * (r2 / denominator);
    let half = DVec2::new(half2.x.max(0.0).sqrt(), half2.y.max(0.0).sqrt());
    Some((p.centre_px + centre - half, p.centre_px + centre + half))
}

/// Box of the disc's bounding quad, clipped at the near plane.
fn clipped_box(
    p: &Projected,
    [u, v]: [DVec3; 2],
    camera: &Camera,
    r: f64,
    near: f64,
) -> Option<(DVec2, DVec2)> {
    let corner = |su: f64, sv: f64| p.centre_in_camera + u * (su * r) + v * (sv * r);
    let quad = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let mut low = DVec2::INFINITY;
    let mut high = DVec2::NEG_INFINITY;
    let mut add = |v: DVec3| {
        if let Some(px) = camera.pinhole.project(v) {
            low = low.min(px);
            high = high.max(px);
        }
    };
    for k in 0..4 {
        let (from, to) = (quad[k], quad[(k + 1) % 4]);
        if from.z >= near {
            add(from);
        }
        if (from.z >= near) != (to.z >= near) {
            add(from + (to - from) * ((near - from.z) / (to.z - from.z)));
        }
    }
    (low.x <= high.x).then_some((low, high))
}
