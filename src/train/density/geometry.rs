//! Sizes of splats in the units of density control: extents of maps, pixels of cameras.

use crate::camera::Camera;
use crate::constants::MAP_SIGMA_MAX;
use crate::model::Model;
use glam::DVec3;
use rayon::prelude::*;

/// Largest map side, in texels (authors' code).
pub const TEXELS_MAX: u16 = 256;

/// Activated opacity of a splat.
pub fn opacity(model: &Model, splat: usize) -> f64 {
    1.0 / (1.0 + f64::from(-model.splats.opacity_logits[splat]).exp())
}

/// Standard deviations of a splat, local units.
pub fn sigmas(model: &Model, splat: usize) -> [f64; 2] {
    [0, 1].map(|axis| f64::from(model.splats.log_scales[2 * splat + axis]).exp())
}

/// Half extents of a map, in the unit of `sigmas`: to where alpha falls to `alpha_texture`, at most three
/// standard deviations (method 6.4). 0 if alpha never reaches it.
pub fn half_extents(sigmas: [f64; 2], opacity: f64, alpha_texture: f64) -> [f64; 2] {
    let radius = (2.0 * (opacity / alpha_texture).ln()).max(0.0).sqrt().min(MAP_SIGMA_MAX);
    sigmas.map(|sigma| sigma * radius)
}

/// Texels that cover a half extent along one axis: even, at least 2, with at most one to spare on each side
/// (method 6.4).
pub fn even_texels(half_extent: f64, texel_size: f64) -> u32 {
    let needed = (2.0 * half_extent / texel_size).ceil().clamp(0.0, 1e6) as u32;
    if needed.is_multiple_of(2) { needed + 2 } else { needed + 1 }
}

/// Edge of a texel with which a 2 x 2 map covers the half extents with a margin.
pub fn first_texel_size(half_extents: [f64; 2]) -> f64 {
    2.5 * half_extents[0].max(half_extents[1])
}

/// For each splat the width of a pixel at its depth, local units, in the nearest camera that has its centre in
/// view. Splats in no view get the largest width found.
pub fn pixel_sizes(model: &Model, cameras: &[Camera]) -> Vec<f64> {
    let positions = &model.splats.positions;
    let mut sizes: Vec<f64> = positions
        .par_chunks_exact(3)
        .map(|p| {
            let centre = DVec3::new(p[0].into(), p[1].into(), p[2].into());
            let seen_by = |camera: &Camera| {
                let in_camera = camera.camera_from_local.transform_point(centre);
                let pinhole = &camera.pinhole;
                let at = pinhole.project(in_camera)?;
                let inside = at.x >= 0.0
                    && at.y >= 0.0
                    && at.x <= f64::from(pinhole.width_px)
                    && at.y <= f64::from(pinhole.height_px)
                    && in_camera.z >= f64::from(model.near);
                inside.then(|| in_camera.z / pinhole.fx_px.max(pinhole.fy_px))
            };
            cameras.iter().filter_map(seen_by).fold(f64::INFINITY, f64::min)
        })
        .collect();
    let largest = sizes.iter().copied().filter(|s| s.is_finite()).fold(0.0, f64::max);
    let unseen = if largest > 0.0 { largest } else { 1.0 };
    sizes.iter_mut().filter(|s| !s.is_finite()).for_each(|s| *s = unseen);
    sizes
}

/// Morton codes of positions, scaled to their bounding box: sorted by them, neighbours in space are neighbours
/// in memory. `positions` is `[n, 3]`.
pub fn morton_codes(positions: &[f32]) -> Vec<u64> {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for p in positions.chunks_exact(3) {
        for axis in 0..3 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    let spread = |value: u64| (0..21).fold(0_u64, |code, bit| code | ((value >> bit) & 1) << (3 * bit));
    let code = |p: &[f32]| {
        (0..3).fold(0, |code, axis| {
            let extent = f64::from(high[axis]) - f64::from(low[axis]);
            let share = (f64::from(p[axis]) - f64::from(low[axis])) / extent.max(1e-30);
            code | spread((share * 2_097_151.0) as u64) << axis
        })
    };
    positions.par_chunks_exact(3).map(code).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_cover_their_extent_with_the_fewest_even_texels() {
        for tenths in 1..400 {
            let half = f64::from(tenths) / 10.0;
            let texels = even_texels(half, 1.0);
            assert!(texels.is_multiple_of(2) && f64::from(texels) >= 2.0 * half, "{half}: {texels}");
            assert!(f64::from(texels) <= 2.0 * half + 3.0, "{half}: {texels}");
        }
        let half = half_extents([0.3, 0.1], 0.9, 1.0 / 255.0);
        assert_eq!(half.map(|h| even_texels(h, first_texel_size(half))), [2, 2]);
        assert_eq!(half_extents([1.0, 1.0], 0.003, 1.0 / 255.0), [0.0; 2], "never drawn");
        assert_eq!(half_extents([1.0, 1.0], 1.0, 1.0 / 255.0), [3.0; 2]);
        assert!(half_extents([1.0, 1.0], 1.0, 0.06)[0] < 2.4);
    }

    #[test]
    fn morton_codes_put_neighbours_together() {
        let grid = |i: usize| [(i % 4) as f32, (i / 4 % 4) as f32, (i / 16) as f32];
        let codes = morton_codes(&(0..64).flat_map(grid).collect::<Vec<_>>());
        let mut order: Vec<usize> = (0..64).collect();
        order.sort_by_key(|&i| codes[i]);
        let widest = |order: &[usize]| {
            let extent = |block: &[usize], axis: usize| {
                let values = block.iter().map(|&i| grid(i)[axis]);
                values.clone().fold(0.0, f32::max) - values.fold(9.0, f32::min)
            };
            let blocks = order.chunks_exact(8);
            blocks.map(|b| (0..3).map(|axis| extent(b, axis)).fold(0.0, f32::max)).fold(0.0, f32::max)
        };
        assert_eq!(widest(&order), 1.0, "every eight form a cube");
        // Negative control: the same positions row by row.
        assert_eq!(widest(&(0..64).collect::<Vec<_>>()), 3.0);
        assert!(morton_codes(&[1.0, 1.0, 1.0]).len() == 1, "a single point does not divide by zero");
    }
}
