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

/// Cuts a window of `new`'s size out of a grid over the map `old`, whose values are `from`; `first` is the row and
/// column of the grid where the window begins. `[new.rows, new.cols, 3]`
pub(super) fn regrid(
    old: &TextureMap,
    from: &[f32],
    new: &TextureMap,
    grid: Grid,
    first: [i32; 2],
    outside: Outside,
) -> Vec<f32> {
    let mut out = vec![0.0; 3 * new.num_texels()];
    if old.num_texels() == 0 {
        return out;
    }
    // For each row or column of the window, its position clamped to the grid, and whether it was inside.
    let places = |count: u16, first: i32, old_count: u16| -> Vec<(usize, bool)> {
        let last = i64::from(grid.texels(old_count)) - 1;
        let place = |i: u16| {
            let at = i64::from(i) + i64::from(first);
            (at.clamp(0, last) as usize, (0..=last).contains(&at))
        };
        (0..count).map(place).collect()
    };
    let rows = places(new.rows, first[0], old.rows);
    let cols = places(new.cols, first[1], old.cols);
    let all = rows.iter().flat_map(|row| cols.iter().map(move |col| (row, col)));
    for (rgb, (row, col)) in out.chunks_exact_mut(3).zip(all) {
        if outside == Outside::Nearest || (row.1 && col.1) {
            (0..3).for_each(|c| rgb[c] = grid_texel(old, from, grid, [row.0, col.0], c));
        }
    }
    out
}

/// One channel of a texel of the grid.
fn grid_texel(old: &TextureMap, from: &[f32], grid: Grid, [row, col]: [usize; 2], channel: usize) -> f32 {
    let texel = |row: usize, col: usize| from[3 * (row * usize::from(old.cols) + col) + channel];
    match grid {
        Grid::Same => texel(row, col),
        Grid::Finer => texel(row / 2, col / 2),
        Grid::Coarser => {
            let (rows, cols) = (quarters(row, old.rows), quarters(col, old.cols));
            mean(rows.map(|row| mean(cols.map(|col| texel(row, col)))))
        }
    }
}

/// The texels that contain the four quarters of a coarse texel, along one axis. A quarter is half a texel, so
/// that maps with an odd number of texels keep their centre too. The outermost texels extend beyond the map.
fn quarters(coarse: usize, texels: u16) -> [usize; 4] {
    let texels = i64::from(texels);
    let padding = (4 - texels % 4) % 4;
    [0, 1, 2, 3].map(|k| (4 * coarse as i64 - padding + k).div_euclid(2).clamp(0, texels - 1) as usize)
}

/// Adds in the same order as the shader.
fn mean([a, b, c, d]: [f32; 4]) -> f32 {
    ((a + b) + (c + d)) * 0.25
}

/// Resamples a map bilinearly, with its new centre `shift` texels of the old map away from the old one; zero outside
/// the old map.
pub(super) fn resample(old: &TextureMap, from: &[f32], new: &TextureMap, shift: [f32; 2]) -> Vec<f32> {
    let same = (old.rows, old.cols, old.texel_size) == (new.rows, new.cols, new.texel_size);
    if same && shift == [0.0; 2] {
        return from.to_vec();
    }
    if old.num_texels() == 0 {
        return vec![0.0; 3 * new.num_texels()];
    }
    let ratio = new.texel_size / old.texel_size;
    let coordinate = |i: u16, size: u16, old_size: u16, shift: f32| {
        (f32::from(i) - (f32::from(size) - 1.0) / 2.0) * ratio + ((f32::from(old_size) - 1.0) / 2.0 + shift)
    };
    let texel = |row: i32, col: i32, c: usize| {
        let inside = row >= 0 && row < i32::from(old.rows) && col >= 0 && col < i32::from(old.cols);
        if inside { from[3 * (row * i32::from(old.cols) + col) as usize + c] } else { 0.0 }
    };
    let mut out = Vec::with_capacity(3 * new.num_texels());
    for i in 0..new.rows {
        let u = coordinate(i, new.rows, old.rows, shift[0]);
        let (row, fu) = (u.floor() as i32, u - u.floor());
        for j in 0..new.cols {
            let v = coordinate(j, new.cols, old.cols, shift[1]);
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
        TextureMap { offset_texels: 0, rows, cols, texel_size }
    }

    /// Irregular values, none of them zero.
    fn values(map: &TextureMap) -> Vec<f32> {
        (0..3 * map.num_texels()).map(|i| 1.5 + (0.7 * i as f32).sin()).collect()
    }

    /// A window of a map's grid: the new map and its values.
    fn window(
        old: &TextureMap,
        from: &[f32],
        grid: Grid,
        size: [u16; 2],
        first: [i32; 2],
        outside: Outside,
    ) -> (TextureMap, Vec<f32>) {
        let new = map(size[0], size[1], old.texel_size * grid.texel_ratio());
        let out = regrid(old, from, &new, grid, first, outside);
        (new, out)
    }

    fn whole(old: &TextureMap, from: &[f32], grid: Grid) -> (TextureMap, Vec<f32>) {
        let size = [old.rows, old.cols].map(|texels| grid.texels(texels));
        window(old, from, grid, size, [0, 0], Outside::Zero)
    }

    #[test]
    fn cropping_and_padding_back_keeps_the_inner_texels_in_place() {
        let old = map(6, 5, 0.1);
        let from = values(&old);
        let (small, cropped) = window(&old, &from, Grid::Same, [3, 2], [1, 2], Outside::Zero);
        for outside in [Outside::Zero, Outside::Nearest] {
            let (_, back) = window(&small, &cropped, Grid::Same, [6, 5], [-1, -2], outside);
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
            assert_ne!(window(&small, &cropped, Grid::Same, [6, 5], [-1, -1], outside).1, back);
        }
        assert_eq!(whole(&old, &from, Grid::Same).1, from);
    }

    #[test]
    fn a_shifted_window_moves_whole_texels() {
        let old = map(4, 4, 0.1);
        let from = values(&old);
        let (_, shifted) = window(&old, &from, Grid::Same, [4, 4], [1, -1], Outside::Zero);
        for (t, rgb) in shifted.chunks_exact(3).enumerate() {
            let (row, col) = (t / 4 + 1, (t % 4).wrapping_sub(1));
            let expected = if row < 4 && col < 4 { &from[3 * (4 * row + col)..][..3] } else { &[0.0; 3] };
            assert_eq!(rgb, expected, "texel {t}");
        }
        // Extreme offsets give zeros or the outermost texel, without overflow.
        for far in [i32::MIN, i32::MAX] {
            let (_, out) = window(&old, &from, Grid::Finer, [2, 2], [far, far], Outside::Zero);
            assert_eq!(out, [0.0; 12]);
            let (_, out) = window(&old, &from, Grid::Coarser, [1, 1], [far, far], Outside::Nearest);
            let corner = if far < 0 { [0, 0] } else { [1, 1] };
            assert_eq!(out[0], grid_texel(&old, &from, Grid::Coarser, corner, 0));
        }
    }

    #[test]
    fn coarsening_inverts_refinement_bit_for_bit() {
        for (rows, cols) in [(2, 2), (4, 6), (8, 2)] {
            let old = map(rows, cols, 0.1);
            let from = values(&old);
            let (fine, refined) = whole(&old, &from, Grid::Finer);
            assert_eq!((fine.rows, fine.cols, fine.texel_size), (2 * rows, 2 * cols, 0.05));
            let (again, back) = whole(&fine, &refined, Grid::Coarser);
            assert_eq!((again.rows, again.cols, again.texel_size), (rows, cols, 0.1));
            assert_eq!(back, from);
            // Negative control: shifted by half a coarse texel.
            let (_, off) =
                window(&fine, &refined, Grid::Same, [2 * rows, 2 * cols], [1, 0], Outside::Nearest);
            assert_ne!(whole(&fine, &off, Grid::Coarser).1, from);
        }
    }

    /// Distance of a row or column from the centre, local units.
    fn from_centre(at: usize, texels: u16, texel_size: f32) -> f32 {
        (at as f32 - (f32::from(texels) - 1.0) / 2.0) * texel_size
    }

    #[test]
    fn coarsened_maps_have_even_sides_and_keep_their_centre() {
        for (rows, cols) in [(8, 12), (6, 10), (5, 7), (9, 6)] {
            let old = map(rows, cols, 0.1);
            let from: Vec<f32> = (0..old.num_texels())
                .flat_map(|t| {
                    let u = from_centre(t / usize::from(cols), rows, 0.1);
                    [u, from_centre(t % usize::from(cols), cols, 0.1), 1.0]
                })
                .collect();
            let (new, out) = whole(&old, &from, Grid::Coarser);
            assert_eq!((new.rows % 2, new.cols % 2), (0, 0));
            // A linear map stays the same function of position, except where the padding reaches.
            let worst = |first: usize| {
                let inner = |t: &usize| {
                    let (row, col) = (t / usize::from(new.cols), t % usize::from(new.cols));
                    (1..usize::from(new.rows) - 1).contains(&row)
                        && (1..usize::from(new.cols) - 1).contains(&col)
                };
                let off = |t: usize| {
                    let u = from_centre(t / usize::from(new.cols) + first, new.rows, new.texel_size);
                    let v = from_centre(t % usize::from(new.cols), new.cols, new.texel_size);
                    (out[3 * t] - u).abs().max((out[3 * t + 1] - v).abs())
                };
                (0..new.num_texels()).filter(inner).map(off).reduce(f32::max).unwrap()
            };
            println!("{rows} x {cols}: {:.1e}", worst(0));
            // Needed 0. Negative control: off by a row.
            assert!(worst(0) < 1e-7, "{rows} x {cols}: {}", worst(0));
            assert!(worst(1) > 0.1);
            assert!(out.iter().skip(2).step_by(3).all(|one| *one == 1.0));
        }
    }

    #[test]
    fn coarsening_pads_with_the_outermost_texels() {
        // 2 rows become 4 by repeating each, so that the means are the texels themselves.
        let old = map(2, 2, 0.1);
        let from = values(&old);
        assert_eq!(whole(&old, &from, Grid::Coarser).1, from);
        // 6 rows become 8: the first pair is row 0 twice, the second is rows 1 and 2.
        assert_eq!(quarters(0, 6), [0, 0, 0, 0]);
        assert_eq!(quarters(1, 6), [1, 1, 2, 2]);
        assert_eq!(quarters(3, 6), [5, 5, 5, 5]);
        // 5 rows are centred in 8: the second coarse texel contains the middle of row 1.
        assert_eq!(quarters(1, 5), [0, 1, 1, 2]);
        assert_eq!(quarters(2, 5), [2, 3, 3, 4]);
    }

    #[test]
    fn a_window_of_an_empty_map_is_zero() {
        for grid in [Grid::Same, Grid::Finer, Grid::Coarser] {
            for outside in [Outside::Zero, Outside::Nearest] {
                assert_eq!(window(&map(0, 0, 0.1), &[], grid, [2, 3], [-1, 0], outside).1, [0.0; 18]);
                let old = map(3, 3, 0.1);
                assert!(window(&old, &values(&old), grid, [0, 0], [0, 0], outside).1.is_empty());
            }
        }
    }

    #[test]
    fn resampling_a_linear_map_is_exact_inside_and_zero_far_outside() {
        let old = map(6, 5, 0.1);
        let from: Vec<f32> = (0..30).flat_map(|t| [(t / 5) as f32, (t % 5) as f32, 1.0]).collect();
        let new = map(4, 3, 0.05);
        let got = resample(&old, &from, &new, [0.0; 2]);
        for (t, rgb) in got.chunks_exact(3).enumerate() {
            let u = (t / 3) as f32 * 0.5 - 0.75 + 2.5;
            let v = (t % 3) as f32 * 0.5 - 0.5 + 2.0;
            assert!((rgb[0] - u).abs() < 1e-5 && (rgb[1] - v).abs() < 1e-5 && rgb[2] == 1.0, "{t}: {rgb:?}");
        }
        let wide = resample(&old, &from, &map(20, 20, 0.1), [0.0; 2]);
        assert_eq!(&wide[..3], &[0.0; 3]);
        assert_eq!(resample(&old, &from, &old, [0.0; 2]), from);
    }
}
