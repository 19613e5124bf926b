//! Points to splats: size from the distance to the neighbours, colour from the point, an empty map.

use super::input::{InitInput, InitOptions};
use super::points::LocalPoint;
use crate::Result;
use crate::constants::SH_0;
use crate::knn::nearest;
use crate::model::{Model, SplatArrays, TextureMap, TexturePool, support_half_extent};
use crate::train::Policy;

/// Opacity of every splat at a point (3DGS).
const OPACITY: f64 = 0.1;

/// Floor of the mean squared spacing, local units (CAT).
const SPACING_FLOOR: f32 = 1e-7;

/// Bounds of the initial standard deviations, local units (method 5.1).
const SIGMA_BOUNDS: (f32, f32) = (1e-7, 1.0);

/// Neighbours that the spacing is the mean over (3DGS).
const NEIGHBOURS: usize = 3;

/// Sets size and opacity of points that neighbour each other.
pub(super) fn size_by_spacing(points: &mut [LocalPoint]) {
    let positions: Vec<[f32; 3]> = points.iter().map(|p| p.position).collect();
    for (point, neighbours) in points.iter_mut().zip(nearest::<NEIGHBOURS>(&positions)) {
        let squares = neighbours.map(|(squared_distance, _)| squared_distance);
        let found: Vec<f32> = squares.into_iter().filter(|d| d.is_finite()).collect();
        let spacing = found.iter().sum::<f32>() / found.len() as f32;
        // A single point becomes as large as allowed.
        let sigma = if found.is_empty() { SIGMA_BOUNDS.1 } else { spacing.max(SPACING_FLOOR).sqrt() };
        point.sigma = sigma.clamp(SIGMA_BOUNDS.0, SIGMA_BOUNDS.1);
        point.opacity = OPACITY;
    }
}

/// A round splat at each point.
pub(super) fn model(input: &InitInput<'_>, points: &[LocalPoint], options: &InitOptions) -> Result<Model> {
    let mut splats = SplatArrays::zeros(points.len(), options.sh_degree);
    splats.positions = points.iter().flat_map(|p| p.position).collect();
    splats.log_scales = points.iter().flat_map(|p| [p.sigma.ln(); 2]).collect();
    splats.opacity_logits = points.iter().map(|p| (p.opacity / (1.0 - p.opacity)).ln() as f32).collect();
    splats.quaternions = points.iter().flat_map(|point| point.quaternion).collect();
    for (splat, point) in points.iter().enumerate() {
        for (out, c) in splats.sh_of_mut(splat).iter_mut().zip(point.rgb) {
            *out = ((f64::from(c) - 0.5) / SH_0) as f32;
        }
    }
    let maps = points.iter().map(|point| first_map(point, options.policy));
    Ok(Model {
        textures: TexturePool::neutral(maps)?,
        splats,
        near: input.near,
        filter: options.filter,
        capture_from_local: input.capture_from_local,
    })
}

/// The map of a round splat.
fn first_map(point: &LocalPoint, policy: Policy) -> TextureMap {
    let half_extent = support_half_extent(f64::from(point.sigma), point.opacity);
    let first = policy.spec().first_map;
    TextureMap::square(first.side(), first.side(), first.texel_size(half_extent) as f32)
}
