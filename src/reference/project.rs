//! Projects a splat to a view: the centred projective map from pixels to the surfel's plane, and the base colour
//! (method sections 1.2, 2.2 and 2.5).

use super::params::Params;
use super::settings::{AlphaCutoff, Settings};
use super::sh::sh_basis;
use crate::camera::Camera;
use crate::constants::{ALPHA_MIN, EDGE_ON_MIN, FOOTPRINT_TEXELS_MAX, sh_coefficients};
use glam::{DMat2, DVec2, DVec3};

/// A splat projected to a view. With `d` the offset of a pixel from the projected centre and `D = 1 + g . d`, the
/// pixel's ray hits the surfel's plane at `(a . d, b . d) / D`, in local units along the surfel's axes, at the depth
/// `depth / D`.
#[derive(Clone, Debug)]
pub struct Projected {
    /// Centre in the image.
    pub centre_px: DVec2,
    /// Numerator of the coordinate along u, local units per pixel.
    pub a: DVec2,
    /// Numerator of the coordinate along v, local units per pixel.
    pub b: DVec2,
    /// Gradient of the denominator, per pixel.
    pub g: DVec2,
    /// Depth of the centre along the optical axis.
    pub depth: f64,
    /// Standard deviations along u and v, local units.
    pub scales: [f64; 2],
    /// Covariance of the falloff in standard deviations along u and v: the identity, plus the low-pass filter.
    pub spread: DMat2,
    /// Size of the area that a sample takes the mean of the texture map over, along rows and columns, in texels; 1:
    /// bilinear interpolation. Constants in the derivative.
    pub footprint_texels: [f64; 2],
    /// Opacity after the filter, 0 to 1.
    pub opacity: f64,
    /// Opacity before the filter.
    pub stored_opacity: f64,
    /// Base colour after the clamp at zero.
    pub base_rgb: DVec3,
    /// Base colour before the clamp at zero.
    pub unclamped_rgb: DVec3,
    /// Centre in camera axes.
    pub centre_in_camera: DVec3,
    /// Tangents `e_u`, `e_v` and normal of the surfel in camera axes.
    pub axes_in_camera: [DVec3; 3],
}

impl Projected {
    /// The map from pixels to standard deviations along u and v, at the projected centre.
    pub(super) fn sigma_from_px(&self) -> DMat2 {
        DMat2::from_cols(self.a / self.scales[0], self.b / self.scales[1]).transpose()
    }

    /// 1 if the normal faces the camera, else -1.
    pub fn facing(&self) -> f64 {
        if self.axes_in_camera[2].dot(self.centre_in_camera) > 0.0 { -1.0 } else { 1.0 }
    }
}

/// Projects splat `i`; `None` if it is culled: it is not finite, in front of the near plane, seen edge-on, or cannot
/// reach an alpha of 1/255.
pub fn project(params: &Params, i: usize, camera: &Camera, settings: &Settings) -> Option<Projected> {
    let p = camera.camera_from_local.transform_point(params.position(i));
    let axes_in_local = params.rotation(i);
    let [e_u, e_v, n] = [0, 1, 2].map(|k| camera.camera_from_local.rotation * axes_in_local.col(k));
    let scales = params.scales(i);
    let stored_opacity = params.opacity(i);
    let finite =
        p.is_finite() && n.is_finite() && (scales[0] * scales[1]).is_finite() && stored_opacity.is_finite();
    if !finite || scales[0] <= 0.0 || scales[1] <= 0.0 || p.z < settings.near {
        return None;
    }
    let alpha_min = match settings.cutoff {
        AlphaCutoff::Hard => ALPHA_MIN,
        AlphaCutoff::Smooth => 0.0,
    };
    if p.dot(n).abs() < EDGE_ON_MIN * p.length() {
        return None;
    }
    let pinhole = &camera.pinhole;
    let per_px = DVec2::new(1.0 / pinhole.fx_px, 1.0 / pinhole.fy_px) / (p.dot(n) / p.z);
    let centre_px = pinhole.project(p)?;
    let unclamped_rgb = sh_colour(params, i, camera, settings.sh_degree);
    let mut projected = Projected {
        centre_px,
        a: e_v.cross(p).truncate() * per_px,
        b: p.cross(e_u).truncate() * per_px,
        spread: DMat2::IDENTITY,
        footprint_texels: [1.0; 2],
        g: n.truncate() * per_px,
        depth: p.z,
        scales,
        opacity: stored_opacity,
        stored_opacity,
        base_rgb: unclamped_rgb.max(DVec3::ZERO),
        unclamped_rgb,
        centre_in_camera: p,
        axes_in_camera: [e_u, e_v, n],
    };
    // The filter's covariance in the image, mapped to the surfel; what widens the falloff thins it.
    let sigma_from_px = projected.sigma_from_px();
    projected.spread += settings.filter_px2 * (sigma_from_px * sigma_from_px.transpose());
    projected.opacity /= projected.spread.determinant().sqrt();
    let map = &params.maps[i];
    if settings.filter_px2 > 0.0 && map.num_texels() > 0 {
        projected.footprint_texels = footprint_texels(&projected, map.texel_sizes.map(f64::from));
    }
    (projected.opacity >= alpha_min).then_some(projected)
}

/// Footprint of a pixel on the texture map: one texel as long as a texel covers a pixel along an axis; beyond that, the
/// variance of a sample stays that of bilinear interpolation between texels of a pixel (method 2.5).
fn footprint_texels(p: &Projected, texel_sizes: [f64; 2]) -> [f64; 2] {
    [(p.a, texel_sizes[0]), (p.b, texel_sizes[1])].map(|(local_per_px, texel_size)| {
        let texels_per_px = local_per_px.length() / texel_size;
        (2.0 * texels_per_px.powi(2) - 1.0).max(1.0).sqrt().min(FOOTPRINT_TEXELS_MAX)
    })
}

fn sh_colour(params: &Params, i: usize, camera: &Camera, degree: u32) -> DVec3 {
    let direction = (params.position(i) - camera.centre_in_local()).normalize();
    let degree = degree.min(params.splats.sh_degrees()[i].into());
    let basis = sh_basis(degree, direction);
    let first = params.splats.sh_offsets()[i] as usize;
    (0..sh_coefficients(degree))
        .map(|k| basis[k] * DVec3::from_slice(&params.splats.sh[first + 3 * k..]))
        .fold(DVec3::splat(0.5), |sum, term| sum + term)
}
