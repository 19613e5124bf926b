//! What is left of a texture map if its texels are averaged in pairs (method 6.5).

use super::texture::TextureMap;

/// A map whose texels are averaged in pairs along some axes: coarse edges meet at the splat's centre.
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

    /// Whether texels are averaged along an axis.
    pub fn is_coarser(&self, axis: usize) -> bool {
        self.along[axis].is_coarser
    }

    /// Rows and columns of the coarser map.
    pub fn sides(&self) -> [u32; 2] {
        [0, 1].map(|axis| self.along[axis].count as u32)
    }

    /// Its shift, in half of its texels.
    pub fn shift(&self) -> [i16; 2] {
        self.shift
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
