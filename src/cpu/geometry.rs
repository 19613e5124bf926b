//! Optional terms on depths and normals (twin: `reference/geometry.rs`): their values, and for each pixel the
//! coefficients of their derivatives, for the backward pass.

use crate::backend::{LossWeights, RenderedImage, TargetImage};
use crate::camera::Pinhole;
use crate::constants::SURFACE_ALPHA_MIN;
use rayon::prelude::*;

/// Coefficients of the derivative with respect to a sample's weight: constant, factors of m and m^2, and the vector
/// multiplied with the sample's normal.
pub(super) type Coefficients = [f32; 6];

/// Sums over a pixel's samples: weight times m, weight times m^2, weight times the normal.
pub(super) type PixelSums = [f32; 5];

/// Weighted distortion and normal terms, and the coefficients of each pixel. `[height, width]`
pub(super) fn geometry_loss(
    image: &RenderedImage,
    sums: &[PixelSums],
    pinhole: &Pinhole,
    target: &TargetImage,
    weights: &LossWeights,
) -> (f64, f64, Vec<Coefficients>) {
    let count = sums.len() as f32;
    let (distortion, normal) = (weights.distortion / count, weights.normal / count);
    let pixels: Vec<([f32; 2], Coefficients)> = (0..sums.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|pixel| {
            if target.mask.as_ref().is_some_and(|m| m[pixel] == 0) {
                return ([0.0; 2], [0.0; 6]);
            }
            let [m1, m2, n_x, n_y, n_z] = sums[pixel];
            let alpha = image.alpha[pixel];
            let mut values = [alpha * m2 - m1 * m1, 0.0];
            let mut c = [distortion * m2, -2.0 * distortion * m1, distortion * alpha, 0.0, 0.0, 0.0];
            if let Some(n) = surface_normal(image, pinhole, pixel) {
                values[1] = alpha - (n_x * n[0] + n_y * n[1] + n_z * n[2]);
                c[0] += normal;
                (0..3).for_each(|k| c[3 + k] = -normal * n[k]);
            }
            (values, c)
        })
        .collect();
    let sum = |k: usize| pixels.iter().map(|(v, _)| f64::from(v[k])).sum::<f64>();
    let values = (f64::from(distortion) * sum(0), f64::from(normal) * sum(1));
    (values.0, values.1, pixels.into_iter().map(|(_, c)| c).collect())
}

/// Normal of the depth map by central differences, in camera axes, facing the camera; `None` at the border and
/// where a neighbour is not opaque.
fn surface_normal(image: &RenderedImage, pinhole: &Pinhole, pixel: usize) -> Option<[f32; 3]> {
    let (w, h) = (image.width_px as usize, image.height_px as usize);
    let (x, y) = (pixel % w, pixel / w);
    if x == 0 || y == 0 || x + 1 >= w || y + 1 >= h {
        return None;
    }
    let point = |x: usize, y: usize| -> Option<glam::Vec3> {
        let at = y * w + x;
        let ray = pinhole.direction_in_camera(glam::DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        (image.alpha[at] >= SURFACE_ALPHA_MIN as f32).then(|| ray.as_vec3() * image.depth[at])
    };
    let along_x = point(x + 1, y)? - point(x - 1, y)?;
    let along_y = point(x, y + 1)? - point(x, y - 1)?;
    let normal = along_y.cross(along_x).try_normalize()?;
    let facing = if normal.dot(point(x, y)?) > 0.0 { -normal } else { normal };
    Some(facing.to_array())
}
