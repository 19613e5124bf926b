//! Resizes texture maps: crops, pads, 2 x upsampling, 2 x 2 averaging, and bilinear resampling. `apply_plan` applies
//! the changes of a plan to a model.

use crate::backend::Grid;
use crate::model::TextureMap;

/// Values outside a map's grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outside {
    /// Zero, for texels and first moments.
    Zero,
    /// Those of the nearest texel, for second moments.
    Nearest,
}

/// Cuts a window of `new`'s size out of the grids over the map `old`, whose values are `from`; `first` is where the window
/// begins, see [`MapChange::Regrid`](crate::backend::MapChange::Regrid). `[new.rows, new.cols, 3]`
pub(super) fn regrid(
    old: &TextureMap,
    from: &[f32],
    new: &TextureMap,
    grids: [Grid; 2],
    first: [i32; 2],
    outside: Outside,
) -> Vec<f32> {
    let mut out = vec![0.0; 3 * new.num_texels()];
    if old.num_texels() == 0 {
        return out;
    }
    let places = |count: u16, axis: usize, old_count: u16| -> Vec<Place> {
        (0..count).map(|i| Place::new(grids[axis], i, first[axis], old_count)).collect()
    };
    let rows = places(new.rows, 0, old.rows);
    let cols = places(new.cols, 1, old.cols);
    let all = rows.iter().flat_map(|row| cols.iter().map(move |col| (row, col)));
    for (rgb, (row, col)) in out.chunks_exact_mut(3).zip(all) {
        if outside == Outside::Nearest || (row.is_inside && col.is_inside) {
            let texel = |i: usize, j: usize, c: usize| {
                from[3 * (row.pair[i] * usize::from(old.cols) + col.pair[j]) + c]
            };
            // Of one texel, the mean is that texel. Adds in the same order as the shader.
            (0..3).for_each(|c| {
                rgb[c] = ((texel(0, 0, c) + texel(0, 1, c)) + (texel(1, 0, c) + texel(1, 1, c))) * 0.25;
            });
        }
    }
    out
}

/// Where a row (or column) of a window comes from.
struct Place {
    /// The two rows of the map whose mean it is, clamped to the map; twice the same unless the grid is coarser.
    pair: [usize; 2],
    /// Whether any of the two was inside the map.
    is_inside: bool,
}

impl Place {
    /// Row `i` of a window that begins at `first`, of a map of `count` rows.
    fn new(grid: Grid, i: u16, first: i32, count: u16) -> Self {
        let (i, first) = (i64::from(i), i64::from(first));
        let pair = match grid {
            Grid::Same => [first + i; 2],
            Grid::Finer => [(first + i).div_euclid(2); 2],
            Grid::Coarser => [first + 2 * i, first + 2 * i + 1],
        };
        let last = i64::from(count) - 1;
        Self { pair: pair.map(|at| at.clamp(0, last) as usize), is_inside: pair[1] >= 0 && pair[0] <= last }
    }
}

/// Resamples a map bilinearly for a splat whose centre is `shift` texels of the old map away from that of the old one; zero
/// outside the old map.
pub(super) fn resample(old: &TextureMap, from: &[f32], new: &TextureMap, shift: [f32; 2]) -> Vec<f32> {
    let same = TextureMap { offset_texels: 0, ..*old } == TextureMap { offset_texels: 0, ..*new };
    if same && shift == [0.0; 2] {
        return from.to_vec();
    }
    if old.num_texels() == 0 {
        return vec![0.0; 3 * new.num_texels()];
    }
    let coordinate = |i: u16, axis: usize| {
        let ratio = new.texel_sizes[axis] / old.texel_sizes[axis];
        (f32::from(i) - new.origin()[axis]) * ratio + (old.origin()[axis] + shift[axis])
    };
    let texel = |row: i32, col: i32, c: usize| {
        let inside = row >= 0 && row < i32::from(old.rows) && col >= 0 && col < i32::from(old.cols);
        if inside { from[3 * (row * i32::from(old.cols) + col) as usize + c] } else { 0.0 }
    };
    let mut out = Vec::with_capacity(3 * new.num_texels());
    for i in 0..new.rows {
        let u = coordinate(i, 0);
        let (row, fu) = (u.floor() as i32, u - u.floor());
        for j in 0..new.cols {
            let v = coordinate(j, 1);
            let (col, fv) = (v.floor() as i32, v - v.floor());
            for c in 0..3 {
                let upper = texel(row, col, c) * (1.0 - fv) + texel(row, col + 1, c) * fv;
                let lower = texel(row + 1, col, c) * (1.0 - fv) + texel(row + 1, col + 1, c) * fv;
                out.push(upper * (1.0 - fu) + lower * fu);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(rows: u16, cols: u16, texel_size: f32) -> TextureMap {
        TextureMap::square(rows, cols, texel_size)
    }

    /// Irregular values, none of them zero.
    fn values(map: &TextureMap) -> Vec<f32> {
        (0..3 * map.num_texels()).map(|i| 1.5 + (0.7 * i as f32).sin()).collect()
    }

    /// The values of a window of a map's grids.
    fn window(
        old: &TextureMap,
        grids: [Grid; 2],
        [rows, cols]: [u16; 2],
        first: [i32; 2],
        outside: Outside,
    ) -> Vec<f32> {
        regrid(old, &values(old), &map(rows, cols, 0.1), grids, first, outside)
    }

    #[test]
    fn cropping_and_padding_back_keeps_the_inner_texels_in_place() {
        let old = map(6, 5, 0.1);
        let from = values(&old);
        let same = [Grid::Same; 2];
        let small = map(3, 2, 0.1);
        let cropped = regrid(&old, &from, &small, same, [1, 2], Outside::Zero);
        for outside in [Outside::Zero, Outside::Nearest] {
            let back = regrid(&small, &cropped, &old, same, [-1, -2], outside);
            for (t, (rgb, before)) in back.chunks_exact(3).zip(from.chunks_exact(3)).enumerate() {
                let (row, col) = (t / 5, t % 5);
                if (1..4).contains(&row) && (2..4).contains(&col) {
                    assert_eq!(rgb, before, "texel {row}, {col}");
                } else if outside == Outside::Zero {
                    assert_eq!(rgb, [0.0; 3], "texel {row}, {col}");
                } else {
                    let nearest = 3 * (row.clamp(1, 3) * 5 + col.clamp(2, 3));
                    assert_eq!(rgb, &from[nearest..nearest + 3], "texel {row}, {col}");
                }
            }
            // Negative control: a window that begins one column later.
            assert_ne!(regrid(&small, &cropped, &old, same, [-1, -1], outside), back);
        }
        assert_eq!(window(&old, same, [6, 5], [0, 0], Outside::Zero), from);
    }

    #[test]
    fn a_shifted_window_moves_whole_texels() {
        let old = map(4, 4, 0.1);
        let from = values(&old);
        let shifted = window(&old, [Grid::Same; 2], [4, 4], [1, -1], Outside::Zero);
        for (t, rgb) in shifted.chunks_exact(3).enumerate() {
            let (row, col) = (t / 4 + 1, (t % 4).wrapping_sub(1));
            let expected = if row < 4 && col < 4 { &from[3 * (4 * row + col)..][..3] } else { &[0.0; 3] };
            assert_eq!(rgb, expected, "texel {t}");
        }
        // Extreme offsets give zeros or the outermost texel, without overflow.
        for far in [i32::MIN, i32::MAX] {
            assert_eq!(window(&old, [Grid::Finer; 2], [2, 2], [far, far], Outside::Zero), [0.0; 12]);
            let out = window(&old, [Grid::Coarser; 2], [1, 1], [far, far], Outside::Nearest);
            assert_eq!(out[0], if far < 0 { from[0] } else { from[45] });
        }
    }

    #[test]
    fn coarsening_inverts_refinement_bit_for_bit_along_each_axis() {
        let (fine, coarse, same) = (Grid::Finer, Grid::Coarser, Grid::Same);
        for (grids, back, finer) in [
            ([fine, fine], [coarse, coarse], [2, 2]),
            ([fine, same], [coarse, same], [2, 1]),
            ([same, fine], [same, coarse], [1, 2]),
        ] {
            for (rows, cols) in [(2, 2), (3, 6), (8, 2)] {
                let old = map(rows, cols, 0.1);
                let from = values(&old);
                let large = map(finer[0] * rows, finer[1] * cols, 0.1);
                let refined = regrid(&old, &from, &large, grids, [0, 0], Outside::Zero);
                assert_eq!(refined.len(), from.len() * usize::from(finer[0] * finer[1]));
                assert_eq!(regrid(&large, &refined, &old, back, [0, 0], Outside::Zero), from);
                // Negative control: pairs that begin one texel later along the refined axes.
                let first = [0, 1].map(|axis| i32::from(grids[axis] == fine));
                assert_ne!(regrid(&large, &refined, &old, back, first, Outside::Nearest), from);
            }
        }
    }

    #[test]
    fn a_texel_without_a_partner_is_its_own_mean() {
        let old = map(3, 2, 0.1);
        let from = values(&old);
        // Row 0 alone, then rows 1 and 2.
        let out = window(&old, [Grid::Coarser, Grid::Same], [2, 2], [-1, 0], Outside::Zero);
        assert_eq!(out[..6], from[..6]);
        for k in 0..6 {
            assert!((out[6 + k] - 0.5 * (from[6 + k] + from[12 + k])).abs() < 1e-6);
        }
        // Pairs outside are zero.
        let out = window(&old, [Grid::Coarser, Grid::Same], [1, 2], [3, 0], Outside::Zero);
        assert_eq!(out, [0.0; 6]);
    }

    #[test]
    fn a_window_of_an_empty_map_is_zero() {
        for grids in [Grid::Same, Grid::Finer, Grid::Coarser].map(|grid| [grid; 2]) {
            for outside in [Outside::Zero, Outside::Nearest] {
                assert_eq!(window(&map(0, 0, 0.1), grids, [2, 3], [-1, 0], outside), [0.0; 18]);
                assert!(window(&map(3, 3, 0.1), grids, [0, 0], [0, 0], outside).is_empty());
            }
        }
    }

    #[test]
    fn resampling_a_linear_map_is_exact_inside_and_zero_far_outside() {
        let old = map(6, 5, 0.1);
        let from: Vec<f32> = (0..30).flat_map(|t| [(t / 5) as f32, (t % 5) as f32, 1.0]).collect();
        let new = TextureMap::centred(4, 3, [0.05, 0.1]);
        let got = resample(&old, &from, &new, [0.0; 2]);
        for (t, rgb) in got.chunks_exact(3).enumerate() {
            let u = (t / 3) as f32 * 0.5 - 0.75 + 2.5;
            let v = (t % 3) as f32 - 1.0 + 2.0;
            assert!((rgb[0] - u).abs() < 1e-5 && (rgb[1] - v).abs() < 1e-5 && rgb[2] == 1.0, "{t}: {rgb:?}");
        }
        let wide = resample(&old, &from, &map(20, 20, 0.1), [0.0; 2]);
        assert_eq!(&wide[..3], &[0.0; 3]);
        assert_eq!(resample(&old, &from, &old, [0.0; 2]), from);
    }
}
