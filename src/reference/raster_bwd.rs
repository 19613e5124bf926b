//! Backward rasterisation: derivatives w.r.t. the projected quantities of each splat and by its texels, back to
//! front over the samples of each pixel (method 2.4).

use super::geometry::{GeometryCoefficients, GeometryLoss};
use super::loss::ImageLoss;
use super::raster_fwd::Sample;
use super::{ColourGradient, Image, Params, Projected, Settings};
use crate::model::texel_value_slope;
use glam::{DVec2, DVec3};

/// Derivatives of the loss with respect to one splat's projected quantities, summed over pixels.
#[derive(Clone, Debug, Default)]
pub struct ScreenGradient {
    /// By the projected centre.
    pub centre_px: DVec2,
    /// By the projective map's numerator along u.
    pub a: DVec2,
    /// By the projective map's numerator along v.
    pub b: DVec2,
    /// By the projective map's denominator.
    pub g: DVec2,
    /// By the logarithms of the standard deviations.
    pub log_scales: [f64; 2],
    /// By the covariance of the falloff, by columns.
    pub spread: [DVec2; 2],
    /// By the opacity after the filter.
    pub opacity: f64,
    /// By the base colour after its clamp.
    pub base_rgb: DVec3,
    /// By the depth of the centre, through the depths of samples.
    pub depth: f64,
    /// By the normal in camera axes, through the normal term.
    pub normal: DVec3,
    /// Covered pixels, blending weight, and blending weight times loss.
    pub statistics: [f64; 3],
}

/// Adds the texel gradients to `grad` and returns the gradients with respect to the projected splats.
pub(super) fn raster_bwd(
    params: &Params,
    projected: &[Option<Projected>],
    image: &Image,
    image_loss: &ImageLoss,
    geometry: &GeometryLoss,
    settings: &Settings,
    grad: &mut Params,
) -> Vec<ScreenGradient> {
    let mut out = vec![ScreenGradient::default(); projected.len()];
    for (pixel, samples) in image.samples.iter().enumerate() {
        let by_pixel = DVec3::from_slice(&image_loss.gradient[3 * pixel..]);
        let mut behind = DVec3::from_array(settings.background) * image.transmittance[pixel];
        let coefficients = geometry.coefficients.get(pixel).copied().unwrap_or_default();
        let mut geometry_behind = 0.0;
        for sample in samples.iter().rev() {
            let Some(p) = &projected[sample.splat] else {
                continue;
            };
            let colour = sample.unclamped_rgb.max(DVec3::ZERO);
            let weight = sample.hit.alpha * sample.transmittance_before;
            let (by_weight, by_m) = geometry_sample(p, sample, &coefficients, weight, settings.near);
            let rest = 1.0 - sample.hit.alpha;
            let by_alpha = by_pixel.dot(colour * sample.transmittance_before - behind / rest)
                + by_weight * sample.transmittance_before
                - geometry_behind / rest;
            behind += colour * weight;
            geometry_behind += by_weight * weight;
            let s = &mut out[sample.splat];
            s.depth -= by_m * settings.near * sample.hit.denominator / (p.depth * p.depth);
            s.normal += weight * p.facing() * coefficients.towards;
            let by_denominator = by_m * settings.near / p.depth;
            s.g += by_denominator * sample.hit.offset_px;
            s.centre_px -= by_denominator * p.g;
            s.statistics[0] += 1.0;
            s.statistics[1] += weight;
            s.statistics[2] += weight * image_loss.map[pixel];
            sample_bwd(params, p, sample, by_alpha, by_pixel * weight, settings, s, grad);
        }
    }
    out
}

/// Derivatives of the distortion and normal terms with respect to a sample's weight and by its m.
fn geometry_sample(
    p: &Projected,
    sample: &Sample,
    c: &GeometryCoefficients,
    weight: f64,
    near: f64,
) -> (f64, f64) {
    let m = near * sample.hit.denominator / p.depth;
    let along = c.towards.dot(p.facing() * p.axes_in_camera[2]);
    (c.constant + c.linear * m + c.square * m * m + along, weight * (c.linear + 2.0 * c.square * m))
}

#[allow(clippy::too_many_arguments, reason = "each quantity of the formula has a name")]
fn sample_bwd(
    params: &Params,
    p: &Projected,
    sample: &Sample,
    by_alpha: f64,
    by_colour_unmasked: DVec3,
    settings: &Settings,
    s: &mut ScreenGradient,
    grad: &mut Params,
) {
    let by_colour = DVec3::from_array([0, 1, 2].map(|c| {
        let raise = settings.colour_gradient == ColourGradient::Projected && by_colour_unmasked[c] < 0.0;
        if sample.unclamped_rgb[c] > 0.0 || raise { by_colour_unmasked[c] } else { 0.0 }
    }));
    s.base_rgb += by_colour;
    let by_texture_plane = texture_bwd(params, sample, by_colour, grad);

    let Projected { a, b, g, scales, opacity, .. } = p;
    let hit = &sample.hit;
    let by_raw_alpha = by_alpha * hit.alpha_slope;
    s.opacity += hit.falloff * by_raw_alpha;
    let by_falloff = opacity * by_raw_alpha;
    let sigmas = DVec2::new(hit.plane[0] / scales[0], hit.plane[1] / scales[1]);
    let slope = p.spread.inverse() * sigmas;
    let mut by_plane = by_texture_plane;
    for k in 0..2 {
        by_plane[k] -= by_falloff * hit.falloff * slope[k] / scales[k];
        s.spread[k] += 0.5 * by_falloff * hit.falloff * slope[k] * slope;
        s.log_scales[k] += by_falloff * hit.falloff * slope[k] * sigmas[k];
    }
    let per = 1.0 / hit.denominator;
    let by_denominator = -(by_plane[0] * hit.plane[0] + by_plane[1] * hit.plane[1]) * per;
    s.a += by_plane[0] * per * hit.offset_px;
    s.b += by_plane[1] * per * hit.offset_px;
    s.g += by_denominator * hit.offset_px;
    s.centre_px -= by_plane[0] * per * *a + by_plane[1] * per * *b + by_denominator * *g;
}

/// Adds the texel gradients of a sample to `grad` and returns the derivative w.r.t. the position on the surfel,
/// through the texture.
fn texture_bwd(params: &Params, sample: &Sample, by_colour: DVec3, grad: &mut Params) -> [f64; 2] {
    let mut by_coordinate = [0.0; 2];
    for tap in &sample.taps {
        let value = params.texel(tap.texel);
        for c in 0..3 {
            grad.texels[tap.texel + c] += by_colour[c] * tap.weight * texel_value_slope(value[c]);
        }
        (0..2).for_each(|k| by_coordinate[k] += tap.slope[k] * by_colour.dot(value));
    }
    let texel_sizes = params.maps[sample.splat].texel_sizes;
    [0, 1].map(|axis| by_coordinate[axis] / f64::from(texel_sizes[axis]))
}
