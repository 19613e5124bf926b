//! What an image loses if a map is coarsened or dropped (method 6.5).

use crate::model::{Model, texel_value};

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
/// if its texels are averaged in pairs along these axes, as [`Grid::Coarser`](crate::backend::Grid) does about the splat's
/// centre, and sampled bilinearly again, with zeros outside. 1 for maps of less than two texels along such an axis.
pub fn coarsening_error(model: &Model, splat: usize, axes: [bool; 2]) -> f64 {
    let map = &model.textures.maps[splat];
    let texels = [usize::from(map.rows), usize::from(map.cols)];
    if (0..2).any(|axis| axes[axis] && texels[axis] < 2) {
        return 1.0;
    }
    let fine: Vec<f64> = model.textures.texels[map.floats()]
        .chunks_exact(3)
        .map(|t| t.iter().map(|&stored| texel_value(stored.into())).sum::<f64>() / 3.0)
        .collect();
    let [along_u, along_v] = [0, 1].map(|axis| {
        // Texel edges of the coarse grid meet at the splat's centre: the first texel may be alone.
        let edge = i32::from(map.shift[axis]) - texels[axis] as i32;
        Coarse::new(texels[axis], axes[axis], edge.div_euclid(2).rem_euclid(2) as usize)
    });
    let cols = texels[1];
    let mean = |row: usize, col: usize| {
        let pair = |i: usize| along_v.pair(col).map(|j| fine[i * cols + j]).iter().sum::<f64>() / 2.0;
        along_u.pair(row).map(pair).iter().sum::<f64>() / 2.0
    };
    let coarse: Vec<f64> =
        (0..along_u.count * along_v.count).map(|k| mean(k / along_v.count, k % along_v.count)).collect();
    let sample = |i: usize, j: usize| {
        let mut sum = 0.0;
        for (row, by_row) in along_u.taps(i) {
            for (col, by_col) in along_v.taps(j) {
                sum += by_row * by_col * coarse[row * along_v.count + col];
            }
        }
        sum
    };
    let (mut weighted, mut weights) = (0.0, 0.0);
    for (i, j) in (0..texels[0]).flat_map(|i| (0..cols).map(move |j| (i, j))) {
        let weight = falloff(model, splat, i, j);
        weighted += weight * (fine[i * cols + j] - sample(i, j)).abs();
        weights += weight;
    }
    weighted / weights.max(1e-300)
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

    /// The coarse texels between which a texel's centre lies, with their weights.
    fn taps(&self, texel: usize) -> impl Iterator<Item = (usize, f64)> {
        let at = if self.is_coarser { ((texel + self.alone) as f64 - 0.5) / 2.0 } else { texel as f64 };
        let (first, f) = (at.floor(), at - at.floor());
        let count = self.count;
        [(first, 1.0 - f), (first + 1.0, f)]
            .into_iter()
            .filter(move |(at, weight)| *weight > 0.0 && (0.0..count as f64).contains(at))
            .map(|(at, weight)| (at as usize, weight))
    }
}
