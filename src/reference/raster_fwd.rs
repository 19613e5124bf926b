//! Forward rasterisation: tests every pixel against every splat, front to back (method 1.3, 1.4 and 2.1).

use super::params::Params;
use super::project::Projected;
use super::settings::{AlphaCutoff, Settings};
use crate::camera::Camera;
use crate::constants::{ALPHA_MAX, ALPHA_MIN, DENOMINATOR_MIN, TRANSMITTANCE_MIN};
use crate::model::TextureMap;
use glam::{DVec2, DVec3};

/// Intersection of a pixel's ray with a splat.
#[derive(Clone, Debug)]
pub struct Hit {
    /// Offset of the pixel from the projected centre.
    pub offset_px: DVec2,
    /// Denominator of the projective map.
    pub denominator: f64,
    /// Coordinates on the surfel, local units along u and v.
    pub plane: [f64; 2],
    /// Gaussian falloff, 0 to 1.
    pub falloff: f64,
    /// Alpha, after clamp and cut-off.
    pub alpha: f64,
    /// Derivative of `alpha` with respect to `opacity * falloff`.
    pub alpha_slope: f64,
}

/// One blended sample.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub splat: usize,
    pub hit: Hit,
    pub transmittance_before: f64,
    /// Base colour plus residual, before the clamp at zero.
    pub unclamped_rgb: DVec3,
    pub taps: Vec<Tap>,
}

/// A rendered image with its samples.
pub struct Image {
    /// Width of the image.
    pub width_px: usize,
    /// Height of the image.
    pub height_px: usize,
    /// Display-space colour over the background. `[height, width, 3]`
    pub rgb: Vec<f64>,
    /// Transmittance behind all samples. `[height, width]`
    pub transmittance: Vec<f64>,
    /// Expected depth of the samples, 0 where there are none. `[height, width]`
    pub depth: Vec<f64>,
    /// Blended normals facing the camera, normalised. `[height, width]`
    pub normal: Vec<DVec3>,
    /// Blended normals facing the camera, not normalised. `[height, width]`
    pub normal_sum: Vec<DVec3>,
    /// Sums of weight times m and weight times m^2, with m the near depth over a sample's depth. `[height, width]`
    pub moments: Vec<[f64; 2]>,
    pub(super) samples: Vec<Vec<Sample>>,
}

/// A texel that a sample takes part of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tap {
    /// First float of the texel.
    pub texel: usize,
    pub weight: f64,
    /// Derivatives of the weight with respect to the texture coordinate.
    pub slope: [f64; 2],
}

/// Taps at a position on the surfel: the mean of the map, zero outside, over a footprint of at least a texel.
pub(super) fn taps(map: &TextureMap, plane: [f64; 2], footprint_texels: [f64; 2]) -> Vec<Tap> {
    let [rows, cols] = [(0, map.rows), (1, map.cols)].map(|(axis, size)| {
        let coordinate = plane[axis] / f64::from(map.texel_sizes[axis]) + f64::from(map.origin()[axis]);
        (0..usize::from(size)).map(move |i| overlap(coordinate - i as f64, footprint_texels[axis]))
    });
    let mut out = Vec::new();
    for (i, (wu, slope_u)) in rows.enumerate() {
        for (j, (wv, slope_v)) in cols.clone().enumerate().filter(|(_, (wv, _))| wu * wv > 0.0) {
            let texel = 3 * (map.offset_texels as usize + i * usize::from(map.cols) + j);
            out.push(Tap { texel, weight: wu * wv, slope: [slope_u * wv, wu * slope_v] });
        }
    }
    out
}

/// Share of a footprint of `width` texels, whose centre is `d` away from that of a texel, that lies on this texel; and
/// the derivative with respect to `d`. At a width of one: the weight of bilinear interpolation.
fn overlap(d: f64, width: f64) -> (f64, f64) {
    let texels = ((1.0 + width) / 2.0 - d.abs()).clamp(0.0, 1.0);
    let on_edge = texels > 0.0 && texels < 1.0;
    (texels / width, if on_edge { -d.signum() / width } else { 0.0 })
}

/// Intersects the ray through `pixel_px` with a splat; `None` where its alpha is zero.
pub fn hit(p: &Projected, pixel_px: DVec2, settings: &Settings) -> Option<Hit> {
    let offset_px = pixel_px - p.centre_px;
    let denominator = 1.0 + p.g.dot(offset_px);
    if denominator < DENOMINATOR_MIN || p.depth < settings.near * denominator {
        return None;
    }
    let plane = [p.a.dot(offset_px) / denominator, p.b.dot(offset_px) / denominator];
    let sigmas = DVec2::new(plane[0] / p.scales[0], plane[1] / p.scales[1]);
    let falloff = (-0.5 * sigmas.dot(p.spread.inverse() * sigmas)).exp();
    let raw = p.opacity * falloff;
    let (alpha, alpha_slope) = match settings.cutoff {
        AlphaCutoff::Hard if raw < ALPHA_MIN => return None,
        AlphaCutoff::Hard if raw > ALPHA_MAX => (ALPHA_MAX, 0.0),
        AlphaCutoff::Hard => (raw, 1.0),
        AlphaCutoff::Smooth => smooth_alpha(raw),
    };
    (alpha > 0.0).then_some(Hit { offset_px, denominator, plane, falloff, alpha, alpha_slope })
}

/// Alpha times a smooth step from 0 at 0.5/255 to 1 at 1.5/255, and the derivative of the product.
fn smooth_alpha(raw: f64) -> (f64, f64) {
    let s = ((raw - 0.5 * ALPHA_MIN) / ALPHA_MIN).clamp(0.0, 1.0);
    let step = s * s * (3.0 - 2.0 * s);
    let step_slope = 6.0 * s * (1.0 - s) / ALPHA_MIN;
    (raw * step, step + raw * step_slope)
}

/// Renders the image, with the splats ordered by (f32 bits of the centre's depth, index).
pub fn raster_fwd(
    params: &Params,
    projected: &[Option<Projected>],
    camera: &Camera,
    settings: &Settings,
) -> Image {
    let mut order: Vec<(u32, usize)> = projected
        .iter()
        .enumerate()
        .filter_map(|(i, p)| p.as_ref().map(|p| ((p.depth as f32).to_bits(), i)))
        .collect();
    order.sort_unstable();
    let (width_px, height_px) = (camera.pinhole.width_px as usize, camera.pinhole.height_px as usize);
    let mut image = Image {
        width_px,
        height_px,
        rgb: Vec::new(),
        transmittance: Vec::new(),
        depth: Vec::new(),
        normal: Vec::new(),
        normal_sum: Vec::new(),
        moments: Vec::new(),
        samples: Vec::new(),
    };
    for y in 0..height_px {
        for x in 0..width_px {
            let pixel_px = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            raster_pixel(params, projected, &order, pixel_px, settings, &mut image);
        }
    }
    image
}

fn raster_pixel(
    params: &Params,
    projected: &[Option<Projected>],
    order: &[(u32, usize)],
    pixel_px: DVec2,
    settings: &Settings,
    image: &mut Image,
) {
    let mut transmittance = 1.0;
    let mut rgb = DVec3::ZERO;
    let mut depth = 0.0;
    let mut normal = DVec3::ZERO;
    let mut moments = [0.0; 2];
    let mut samples = Vec::new();
    for &(_, splat) in order {
        let Some(p) = &projected[splat] else { continue };
        let Some(hit) = hit(p, pixel_px, settings) else {
            continue;
        };
        let after = transmittance * (1.0 - hit.alpha);
        if settings.cutoff == AlphaCutoff::Hard && after < TRANSMITTANCE_MIN {
            break;
        }
        let map = &params.maps[splat];
        let taps = taps(map, hit.plane, p.footprint_texels);
        let residual: DVec3 = taps.iter().map(|tap| tap.weight * params.texel(tap.texel)).sum();
        let unclamped_rgb = p.base_rgb + residual;
        let weight = hit.alpha * transmittance;
        rgb += unclamped_rgb.max(DVec3::ZERO) * weight;
        depth += weight * p.depth / hit.denominator;
        let m = settings.near * hit.denominator / p.depth;
        moments[0] += weight * m;
        moments[1] += weight * m * m;
        normal += weight * p.facing() * p.axes_in_camera[2];
        samples.push(Sample { splat, hit, transmittance_before: transmittance, unclamped_rgb, taps });
        transmittance = after;
    }
    rgb += DVec3::from_array(settings.background) * transmittance;
    image.rgb.extend_from_slice(&rgb.to_array());
    image.transmittance.push(transmittance);
    image.depth.push(if transmittance < 1.0 { depth / (1.0 - transmittance) } else { 0.0 });
    image.normal.push(normal.normalize_or_zero());
    image.normal_sum.push(normal);
    image.moments.push(moments);
    image.samples.push(samples);
}
