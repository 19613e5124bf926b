//! The reference renderer: f64, single-threaded, straight from the formulas, obviously right rather than fast.
//! Tests and `litetex selftest` compare the production backends with it; each of their kernels has its twin here
//! under the same name. No tiles, no culling by bounds, no optimisations.

mod adam;
mod bounds;
mod exposure;
mod fragments;
mod geometry;
mod loss;
mod params;
mod project;
mod project_bwd;
mod raster_bwd;
mod raster_fwd;
mod settings;
mod sh;

pub use adam::{adam_dense, adam_skipped, map_rate};
pub use bounds::{PixelBounds, pixel_bounds};
pub use exposure::{exposure_bwd, exposure_fwd};
pub use fragments::{Fragments, fragments};
pub use geometry::{GeometryCoefficients, GeometryLoss, geometry_loss, surface_normals};
pub use loss::{ImageLoss, image_loss};
pub use params::Params;
pub use project::{Projected, project};
pub use raster_fwd::{Hit, Image, hit, raster_fwd};
pub use settings::{AlphaCutoff, ColourGradient, Settings};
pub use sh::{sh_basis, sh_basis_derivative};

use crate::backend::{LossValues, LossWeights, TargetImage};
use crate::camera::Camera;
use glam::{DVec2, DVec3};

/// Result of a forward and a backward pass.
pub struct Gradients {
    /// Rendered image.
    pub image: Image,
    /// Loss terms, weighted.
    pub loss: LossValues,
    /// Derivative of the total loss with respect to every stored parameter.
    pub params: Params,
    /// Whether alpha reaches 1/255 at any pixel, hidden by other splats or not. `[n]`
    pub visible: Vec<bool>,
    /// Covered pixels, blending weight, and blending weight times loss; not normalised. `[n]`
    pub statistics: Vec<[f64; 3]>,
    /// Normals of the depth map. `[height, width]`
    pub surface_normals: Vec<DVec3>,
}

/// Loss of a view and its derivative with respect to every parameter (method sections 2.4 and 3).
pub fn gradients(
    params: &Params,
    camera: &Camera,
    target: &TargetImage,
    weights: &LossWeights,
    settings: &Settings,
) -> Gradients {
    gradients_at(params, camera, target, weights, settings, None)
}

/// What depends on the parameters but counts as constant in the derivative.
pub struct Constants {
    /// Normals of the depth map. `[height, width]`
    pub normals: Vec<DVec3>,
    /// Footprints of a pixel on the texture maps, texels along rows and columns. `[n, 2]`
    pub footprints_texels: Vec<[f64; 2]>,
}

/// [`gradients`] with given constants, which central differences must keep fixed.
pub fn gradients_at(
    params: &Params,
    camera: &Camera,
    target: &TargetImage,
    weights: &LossWeights,
    settings: &Settings,
    constants: Option<&Constants>,
) -> Gradients {
    let mut projected: Vec<Option<Projected>> =
        (0..params.splats.len()).map(|i| project(params, i, camera, settings)).collect();
    if let Some(constants) = constants {
        for (projected, &footprint_texels) in projected.iter_mut().zip(&constants.footprints_texels) {
            projected.iter_mut().for_each(|p| p.footprint_texels = footprint_texels);
        }
    }
    let visible: Vec<bool> =
        projected.iter().map(|p| p.as_ref().is_some_and(|p| is_visible(p, camera, settings))).collect();
    let image = raster_fwd(params, &projected, camera, settings);
    let (corrected, _) = exposure_fwd(&image.rgb, target, settings.background, &settings.exposure);
    let mut losses = image_loss(&corrected, target, settings.background, weights);
    losses.gradient = exposure_bwd(&losses.gradient, &settings.exposure);
    let surface_normals = constants.map_or_else(|| surface_normals(&image, camera), |c| c.normals.clone());
    let geometry = geometry_loss(&image, &surface_normals, target, weights);
    let mut grad = params.zeros_like();
    let splat_grads =
        raster_bwd::raster_bwd(params, &projected, &image, &losses, &geometry, settings, &mut grad);
    for (i, (projected, screen)) in projected.iter().zip(&splat_grads).enumerate() {
        if let Some(projected) = projected {
            project_bwd::project_bwd(params, i, projected, screen, camera, settings, &mut grad);
        }
    }
    let mut loss = losses.values;
    (loss.distortion, loss.normal) = (geometry.distortion, geometry.normal);
    regularise(params, &visible, weights, &mut loss, &mut grad);
    loss.total =
        loss.l1 + loss.dssim + loss.mse + loss.opacity + loss.texture + loss.distortion + loss.normal;
    let statistics = splat_grads.iter().map(|s| s.statistics).collect();
    Gradients { image, loss, params: grad, visible, statistics, surface_normals }
}

/// Whether alpha reaches 1/255 at any pixel centre, hidden by other splats or not.
fn is_visible(p: &Projected, camera: &Camera, settings: &Settings) -> bool {
    pixel_bounds(p, camera, settings.near).is_some_and(|b| {
        let mut pixels = (b.y0..b.y1).flat_map(|y| (b.x0..b.x1).map(move |x| (x, y)));
        pixels.any(|(x, y)| hit(p, DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), settings).is_some())
    })
}

/// Adds the opacity and texture terms (method section 3) over the visible splats.
fn regularise(
    params: &Params,
    visible: &[bool],
    weights: &LossWeights,
    loss: &mut LossValues,
    grad: &mut Params,
) {
    let opacity_weight = f64::from(weights.opacity) / params.splats.len().max(1) as f64;
    for i in (0..params.splats.len()).filter(|&i| visible[i]) {
        let o = params.opacity(i);
        loss.opacity += opacity_weight * o;
        grad.splats.opacity_logits[i] += opacity_weight * o * (1.0 - o);
        let texture_weight = f64::from(weights.texture);
        for t in params.maps[i].floats() {
            let v = crate::model::texel_value(params.texels[t]);
            loss.texture += texture_weight * v.abs();
            // The derivative at exactly 0 is 0, so that neutral texels stay neutral.
            let sign = if v == 0.0 { 0.0 } else { v.signum() };
            grad.texels[t] += texture_weight * sign * crate::model::texel_value_slope(v);
        }
    }
}
