//! Optional terms on depths and normals (method section 3): distortion and normal consistency. They depend on each
//! sample's weight and depth, and on the normal of its splat.

use super::raster_fwd::Image;
use crate::backend::{LossWeights, TargetImage};
use crate::camera::Camera;
use crate::constants::SURFACE_ALPHA_MIN;
use glam::{DVec2, DVec3};

/// Coefficients of both terms' derivatives at a pixel. With `m` the near depth over a sample's depth and `n`
/// its normal facing the camera, the derivative w.r.t. the sample's weight is `constant + linear m + square m^2 +
/// towards . n`, and the derivative with respect to `m` is `weight (linear + 2 square m)`.
#[derive(Clone, Copy, Debug, Default)]
pub struct GeometryCoefficients {
    /// Constant part.
    pub constant: f64,
    /// Factor of m.
    pub linear: f64,
    /// Factor of m squared.
    pub square: f64,
    /// Vector multiplied with the normal, camera axes.
    pub towards: DVec3,
}

/// Values of both terms, and the coefficients of their derivatives.
#[derive(Default)]
pub struct GeometryLoss {
    /// Distortion term, weighted.
    pub distortion: f64,
    /// Normal term, weighted.
    pub normal: f64,
    /// Coefficients by pixel, empty if both terms are off. `[height, width]`
    pub coefficients: Vec<GeometryCoefficients>,
}

/// Distortion `A M2 - M1^2`, with A, M1, M2 the sums of w, w m, w m^2 over a pixel's samples, which equals the sum of
/// `w_i w_j (m_i - m_j)^2` over pairs of samples; and normal consistency, the sum of `w (1 - n . surface)`. Both are
/// means over all pixels; masked pixels count as 0. Surface normals are constants in the derivative.
pub fn geometry_loss(
    image: &Image,
    normals: &[DVec3],
    target: &TargetImage,
    weights: &LossWeights,
) -> GeometryLoss {
    let mut out = GeometryLoss::default();
    if !weights.needs_geometry() {
        return out;
    }
    let count = image.transmittance.len() as f64;
    let (distortion, normal) = (f64::from(weights.distortion) / count, f64::from(weights.normal) / count);
    for (pixel, moments) in image.moments.iter().enumerate() {
        let mut c = GeometryCoefficients::default();
        if target.counts(pixel) {
            let alpha = 1.0 - image.transmittance[pixel];
            out.distortion += distortion * (alpha * moments[1] - moments[0] * moments[0]);
            c.constant = distortion * moments[1];
            c.linear = -2.0 * distortion * moments[0];
            c.square = distortion * alpha;
            let surface = normals[pixel];
            if surface != DVec3::ZERO {
                out.normal += normal * (alpha - image.normal_sum[pixel].dot(surface));
                c.constant += normal;
                c.towards = -normal * surface;
            }
        }
        out.coefficients.push(c);
    }
    out
}

/// Normals of the depth map by central differences, in camera axes, facing the camera; zero at the border and where a
/// neighbour is not opaque. `[height, width]`
pub fn surface_normals(image: &Image, camera: &Camera) -> Vec<DVec3> {
    let (w, h) = (image.width_px, image.height_px);
    let point = |x: usize, y: usize| {
        let pixel = y * w + x;
        let opaque = 1.0 - image.transmittance[pixel] >= SURFACE_ALPHA_MIN;
        let ray = camera.pinhole.direction_in_camera(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        opaque.then(|| ray * image.depth[pixel])
    };
    let normal = |x: usize, y: usize| -> Option<DVec3> {
        let inside = x > 0 && y > 0 && x + 1 < w && y + 1 < h;
        if !inside {
            return None;
        }
        let along_x = point(x + 1, y)? - point(x - 1, y)?;
        let along_y = point(x, y + 1)? - point(x, y - 1)?;
        let normal = along_y.cross(along_x).try_normalize()?;
        Some(if normal.dot(point(x, y)?) > 0.0 { -normal } else { normal })
    };
    (0..w * h).map(|i| normal(i % w, i / w).unwrap_or(DVec3::ZERO)).collect()
}
