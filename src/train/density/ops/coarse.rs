//! What an image loses if a map is coarsened or dropped (method 6.5).

use super::regrid::{merged_moments, window};
use crate::backend::{Grid, MapChange};
use crate::model::{Coarsening, Model, TextureMap, texel_value};

/// Mean absolute residual of the map (mean over channels, weighted by the splat's falloff at the texels): what
/// the image loses if the map is dropped. 1 for a splat without a map.
pub fn residual(model: &Model, splat: usize) -> f64 {
    let map = &model.textures.maps[splat];
    let texels = model.textures.texels[map.floats()].chunks_exact(3);
    let values = texels.map(|t| t.iter().map(|&stored| texel_value(stored.into()).abs()).sum::<f64>() / 3.0);
    let (mut weighted, mut weights) = (0.0, 0.0);
    for (t, value) in values.enumerate() {
        let weight = falloff(model, splat, t / usize::from(map.cols), t % usize::from(map.cols));
        weighted += weight * value;
        weights += weight;
    }
    if weights > 0.0 { weighted / weights } else { 1.0 }
}

/// The splat's falloff at the centre of a texel.
fn falloff(model: &Model, splat: usize, row: usize, col: usize) -> f64 {
    let map = &model.textures.maps[splat];
    let squared = |axis: usize, at: usize| {
        let offset = (at as f64 - f64::from(map.origin()[axis])) * f64::from(map.texel_sizes[axis]);
        let sigma = f64::from(model.splats.log_scales[2 * splat + axis]).exp();
        (offset / sigma).powi(2)
    };
    (-0.5 * (squared(0, row) + squared(1, col))).exp()
}

/// How much the map varies along u and along v: mean squared difference between neighbours, summed over channels and
/// weighted by the splat's falloff between them. 0 along an axis of one texel.
pub fn detail(model: &Model, splat: usize) -> [f64; 2] {
    let map = &model.textures.maps[splat];
    let (rows, cols) = (usize::from(map.rows), usize::from(map.cols));
    let texels = &model.textures.texels[map.floats()];
    let value = |t: usize, c: usize| texel_value(texels[3 * t + c].into());
    [[1, 0], [0, 1]].map(|[by_row, by_col]| {
        let (mut weighted, mut weights) = (0.0, 0.0);
        for (i, j) in (by_row..rows).flat_map(|i| (by_col..cols).map(move |j| (i, j))) {
            let (t, before) = (i * cols + j, (i - by_row) * cols + j - by_col);
            let weight = (falloff(model, splat, i, j) * falloff(model, splat, i - by_row, j - by_col)).sqrt();
            weighted += weight * (0..3).map(|c| (value(t, c) - value(before, c)).powi(2)).sum::<f64>();
            weights += weight;
        }
        if weights > 0.0 { weighted / weights } else { 0.0 }
    })
}

/// Mean absolute change of the map's image (mean over channels, weighted by the splat's falloff at the texels)
/// if it is coarsened along these axes. 1 for maps of less than two texels along such an axis.
pub fn coarsening_error(model: &Model, splat: usize, axes: [bool; 2]) -> f64 {
    let map = &model.textures.maps[splat];
    let Some(coarser) = Coarsening::new(map, axes) else { return 1.0 };
    let fine: Vec<f64> = model.textures.texels[map.floats()]
        .chunks_exact(3)
        .map(|t| t.iter().map(|&stored| texel_value(stored.into())).sum::<f64>() / 3.0)
        .collect();
    let (mut weighted, mut weights) = (0.0, 0.0);
    for (t, (fine, sampled)) in fine.iter().zip(coarser.sampled(&fine)).enumerate() {
        let weight = falloff(model, splat, t / usize::from(map.cols), t % usize::from(map.cols));
        weighted += weight * (fine - sampled).abs();
        weights += weight;
    }
    weighted / weights.max(1e-300)
}

/// The change that makes a coarser map.
pub fn coarsened(map: &TextureMap, coarser: &Coarsening) -> MapChange {
    let grids = [0, 1].map(|axis| if coarser.is_coarser(axis) { Grid::Coarser } else { Grid::Same });
    window(map, grids, coarser.sides(), coarser.shift(), [0; 2], merged_moments(grids))
}
