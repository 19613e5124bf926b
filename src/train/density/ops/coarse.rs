//! What an image loses if a map is coarsened or dropped (method 6.5).

use super::regrid::{merged_moments, window};
use crate::backend::{Grid, MapChange};
use crate::model::{Model, TextureMap, texel_value};

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

/// A map whose texels are averaged in pairs along some axes, as [`Grid::Coarser`] does about the splat's centre.
pub struct Coarsening {
    along: [Coarse; 2],
    /// Shift of the coarser map.
    shift: [i16; 2],
}

impl Coarsening {
    /// The map coarsened along these axes; `None` for maps of less than two texels along such an axis.
    pub fn new(map: &TextureMap, axes: [bool; 2]) -> Option<Self> {
        let texels = [usize::from(map.rows), usize::from(map.cols)];
        if (0..2).any(|axis| axes[axis] && texels[axis] < 2) {
            return None;
        }
        // Texel edges of the coarse grid meet at the splat's centre: the first texel may be alone.
        let first_edge = [0, 1].map(|axis| (i32::from(map.shift[axis]) - texels[axis] as i32).div_euclid(2));
        let along =
            [0, 1].map(|axis| Coarse::new(texels[axis], axes[axis], first_edge[axis].rem_euclid(2) as usize));
        let shift = [0, 1].map(|axis| match axes[axis] {
            // The first edge, in half texels of the coarser map, and half of its texels.
            true => (first_edge[axis] - along[axis].alone as i32 + along[axis].count as i32) as i16,
            false => map.shift[axis],
        });
        Some(Self { along, shift })
    }

    /// Texels of the coarser map.
    pub fn num_texels(&self) -> usize {
        self.along[0].count * self.along[1].count
    }

    /// The change that makes the coarser map.
    pub fn change(&self, map: &TextureMap) -> MapChange {
        let grids = [0, 1].map(|axis| if self.along[axis].is_coarser { Grid::Coarser } else { Grid::Same });
        let texels = [0, 1].map(|axis| self.along[axis].count as u32);
        window(map, grids, texels, self.shift, [0; 2], merged_moments(grids))
    }

    /// What the coarser map shows at the centres of the texels, sampled bilinearly with zeros outside, for one channel of
    /// the texels. `[rows * cols]`
    pub fn sampled(&self, fine: &[f64]) -> Vec<f64> {
        let [along_u, along_v] = &self.along;
        let (cols, coarse_cols) = (along_v.texels, along_v.count);
        let pairs: Vec<[usize; 2]> = (0..coarse_cols).map(|col| along_v.pair(col)).collect();
        let mut coarse = Vec::with_capacity(self.num_texels());
        for [a, b] in (0..along_u.count).map(|row| along_u.pair(row)) {
            let mean = |i: usize, [j, k]: [usize; 2]| (fine[i * cols + j] + fine[i * cols + k]) / 2.0;
            coarse.extend(pairs.iter().map(|&pair| (mean(a, pair) + mean(b, pair)) / 2.0));
        }
        // The taps of columns are the same in every row.
        let taps: Vec<[(usize, f64); 2]> = (0..cols).map(|j| along_v.taps(j)).collect();
        let mut sampled = Vec::with_capacity(along_u.texels * cols);
        for taps_u in (0..along_u.texels).map(|i| along_u.taps(i)) {
            sampled.extend(taps.iter().map(|taps_v| {
                let mut sum = 0.0;
                for (row, by_row) in taps_u {
                    for (col, by_col) in *taps_v {
                        sum += by_row * by_col * coarse[row * coarse_cols + col];
                    }
                }
                sum
            }));
        }
        sampled
    }
}

/// The texels of a map along one axis, in pairs or each by itself.
struct Coarse {
    /// Texels of the map.
    texels: usize,
    /// Texels after averaging.
    count: usize,
    /// Whether texels are averaged.
    is_coarser: bool,
    /// 1 if the first texel has no partner.
    alone: usize,
}

impl Coarse {
    fn new(texels: usize, is_coarser: bool, alone: usize) -> Self {
        let count = if is_coarser { (texels + alone).div_ceil(2) } else { texels };
        Self { texels, count, is_coarser, alone }
    }

    /// The two texels of a coarse one; the same twice if it has only one.
    fn pair(&self, coarse: usize) -> [usize; 2] {
        if !self.is_coarser {
            return [coarse; 2];
        }
        [0, 1].map(|k| (2 * coarse + k).saturating_sub(self.alone).min(self.texels - 1))
    }

    /// The coarse texels between which a texel's centre lies, with their weights: 0 for those outside.
    fn taps(&self, texel: usize) -> [(usize, f64); 2] {
        let at = if self.is_coarser { ((texel + self.alone) as f64 - 0.5) / 2.0 } else { texel as f64 };
        let (first, f) = (at.floor(), at - at.floor());
        [(first, 1.0 - f), (first + 1.0, f)].map(|(at, weight)| {
            let is_inside = (0.0..self.count as f64).contains(&at);
            if is_inside { (at as usize, weight) } else { (0, 0.0) }
        })
    }
}
