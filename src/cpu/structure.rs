//! Applies a structure plan: gathers splats, keeps or resamples their maps and moments.

use crate::backend::{Grid, MapChange, StructurePlan};
use crate::model::{AdamState, Model, SplatArrays, SplatGroup, TextureMap, TexturePool};
use rayon::prelude::*;

/// The model and optimiser state after the plan, which must have been checked.
pub(super) fn apply_plan(model: &Model, adam: &AdamState, plan: &StructurePlan) -> (Model, AdamState) {
    let gather = |arrays: &SplatArrays| arrays.gathered(&plan.sources);
    let old = &model.textures.maps;
    let extents = plan.sources.iter().zip(&plan.maps).map(|(&s, change)| match *change {
        MapChange::Keep => {
            let map = &old[s as usize];
            (map.rows, map.cols, map.texel_size)
        }
        MapChange::Resample { rows, cols, texel_size, .. } => (rows, cols, texel_size),
        MapChange::Regrid { grid, rows, cols, .. } => {
            (rows, cols, old[s as usize].texel_size * grid.texel_ratio())
        }
    });
    let mut textures = TexturePool::neutral(extents);
    let carry_all = |from: &[f32], kind: Kind| -> Vec<f32> {
        let parts: Vec<Vec<f32>> = plan
            .sources
            .par_iter()
            .zip(&plan.maps)
            .zip(&textures.maps)
            .with_min_len(256)
            .map(|((&s, change), new)| {
                let map = &old[s as usize];
                let values = &from[map.floats()];
                let mut part = match *change {
                    MapChange::Keep => values.to_vec(),
                    MapChange::Resample { shift_texels, .. } => resample(map, values, new, shift_texels),
                    MapChange::Regrid { grid, first_row, first_col, .. } => {
                        regrid(map, values, new, grid, [first_row, first_col], kind)
                    }
                };
                let factor = kind.factor(change);
                part.iter_mut().for_each(|value| *value *= factor);
                part
            })
            .collect();
        parts.concat()
    };
    let texels = carry_all(&model.textures.texels, Kind::Texel);
    let texels_m = carry_all(&adam.texels_m, Kind::FirstMoment);
    let texels_v = carry_all(&adam.texels_v, Kind::SecondMoment);
    textures.texels = texels;
    let (mut splats, mut splats_m) = (gather(&model.splats), gather(&adam.splats_m));
    for edit in &plan.edits {
        let i = edit.splat as usize;
        splats.positions[3 * i..3 * i + 3].copy_from_slice(&edit.position);
        splats.log_scales[2 * i..2 * i + 2].copy_from_slice(&edit.log_scales);
        splats.opacity_logits[i] = edit.opacity_logit;
        for group in SplatGroup::ALL {
            let width = group.width(splats_m.sh_degree);
            splats_m.group_mut(group)[i * width..(i + 1) * width].fill(0.0);
        }
    }
    let adam = AdamState {
        splats_m,
        splats_v: gather(&adam.splats_v),
        texels_m,
        texels_v,
        last_step: plan.sources.iter().map(|&s| adam.last_step[s as usize]).collect(),
        ..*adam
    };
    let model = Model { splats, textures, ..*model };
    (model, adam)
}

/// What the values of a map are.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Texel,
    FirstMoment,
    SecondMoment,
}

impl Kind {
    /// What a change multiplies them by.
    fn factor(self, change: &MapChange) -> f32 {
        match (self, change) {
            (Self::Texel, _) | (_, MapChange::Keep) => 1.0,
            (_, MapChange::Resample { moment_scale, .. } | MapChange::Regrid { moment_scale, .. }) => {
                moment_scale[usize::from(self == Self::SecondMoment)]
            }
        }
    }
}

/// A window of the map on one of its grids; see [`Grid`] for what lies outside.
fn regrid(
    old: &TextureMap,
    from: &[f32],
    new: &TextureMap,
    grid: Grid,
    first: [i32; 2],
    kind: Kind,
) -> Vec<f32> {
    let (rows, cols) = (i32::from(old.rows), i32::from(old.cols));
    let (grid_rows, grid_cols) = (i32::from(grid.texels(old.rows)), i32::from(grid.texels(old.cols)));
    if rows == 0 {
        return vec![0.0; 3 * new.num_texels()];
    }
    let texel = |row: i32, col: i32, c: usize| from[3 * (row * cols + col) as usize + c];
    let at = |row: i32, col: i32, c: usize| match grid {
        Grid::Same => texel(row, col, c),
        Grid::Finer => texel(row / 2, col / 2, c),
        Grid::Coarser => {
            let (pad_u, pad_v) = ((2 * grid_rows - rows) / 2, (2 * grid_cols - cols) / 2);
            let padded = |i: i32, j: i32| {
                let row = (2 * row + i - pad_u).clamp(0, rows - 1);
                texel(row, (2 * col + j - pad_v).clamp(0, cols - 1), c)
            };
            0.25 * ((padded(0, 0) + padded(0, 1)) + (padded(1, 0) + padded(1, 1)))
        }
    };
    let mut out = Vec::with_capacity(3 * new.num_texels());
    for i in 0..i32::from(new.rows) {
        for j in 0..i32::from(new.cols) {
            let (row, col) = (i + first[0], j + first[1]);
            let near = (row.clamp(0, grid_rows - 1), col.clamp(0, grid_cols - 1));
            let outside = near != (row, col) && kind != Kind::SecondMoment;
            (0..3).for_each(|c| out.push(if outside { 0.0 } else { at(near.0, near.1, c) }));
        }
    }
    out
}

/// Bilinear resampling about the old map's centre moved by `shift` of its texels; zero outside the old map.
fn resample(old: &TextureMap, from: &[f32], new: &TextureMap, shift: [f32; 2]) -> Vec<f32> {
    let same = (old.rows, old.cols, old.texel_size) == (new.rows, new.cols, new.texel_size);
    if same && shift == [0.0; 2] {
        return from.to_vec();
    }
    if old.rows == 0 {
        return vec![0.0; 3 * new.num_texels()];
    }
    let ratio = new.texel_size / old.texel_size;
    let coordinate = |i: u16, size: u16, old_size: u16, shift: f32| {
        (f32::from(i) - (f32::from(size) - 1.0) / 2.0) * ratio + shift + (f32::from(old_size) - 1.0) / 2.0
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
    use crate::selftest::{SceneOptions, random_scene};

    fn map(rows: u16, cols: u16, texel_size: f32) -> TextureMap {
        TextureMap { offset_texels: 0, rows, cols, texel_size }
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

    /// A small model with moments that are no round numbers, and a plan of `change` for its first map.
    fn planned(change: MapChange) -> (Model, AdamState, StructurePlan) {
        let options = SceneOptions { num_splats: 3, map_sizes: vec![(4, 3)], ..SceneOptions::default() };
        let model = random_scene(&options).model;
        let mut adam = AdamState::zeros(&model);
        adam.texels_m.iter_mut().enumerate().for_each(|(i, m)| *m = 0.1 * (i as f32).sin());
        adam.texels_v.iter_mut().enumerate().for_each(|(i, v)| *v = 0.01 * (i as f32).cos().abs());
        adam.splats_m.positions.fill(0.3);
        let maps = vec![change, MapChange::Keep, MapChange::Keep];
        (model, adam, StructurePlan { sources: vec![0, 1, 2], maps, ..StructurePlan::default() })
    }

    #[test]
    fn moments_are_scaled_after_resampling_and_nothing_else_is() {
        // Twice as many texels per axis, and the same size (which is not resampled).
        for (rows, cols, finer) in [(8, 6, 0.5), (4, 3, 1.0)] {
            let run = |moment_scale| {
                let (model, adam, mut plan) = planned(MapChange::Keep);
                let texel_size = finer * model.textures.maps[0].texel_size;
                plan.maps[0] =
                    MapChange::Resample { rows, cols, texel_size, shift_texels: [0.0; 2], moment_scale };
                plan.check(3).unwrap();
                apply_plan(&model, &adam, &plan)
            };
            let (plain_model, plain) = run([1.0, 1.0]);
            let (model, adam) = run([0.25, 0.0625]);
            assert_eq!(model, plain_model, "texels and splats are not scaled");
            let first = model.textures.maps[0].floats();
            let scaled = |v: &[f32], f: f32| v[first.clone()].iter().map(|v| f * v).collect::<Vec<_>>();
            assert_eq!(adam.texels_m[first.clone()], scaled(&plain.texels_m, 0.25));
            assert_eq!(adam.texels_v[first.clone()], scaled(&plain.texels_v, 0.0625));
            assert!(plain.texels_m[first.clone()].iter().filter(|m| **m != 0.0).count() > 20);
            // The kept maps and the moments of the splats stay.
            assert_eq!(adam.texels_m[first.end..], plain.texels_m[first.end..]);
            assert_eq!(adam.texels_v[first.end..], plain.texels_v[first.end..]);
            assert_eq!((&adam.splats_m, &adam.splats_v), (&plain.splats_m, &plain.splats_v));
            // Negative control: exchanged factors show in both moments.
            let (_, exchanged) = run([0.0625, 0.25]);
            assert!(exchanged.texels_m != adam.texels_m && exchanged.texels_v != adam.texels_v);
        }
    }

    #[test]
    fn a_scale_of_one_keeps_every_bit_of_a_map_of_the_same_size() {
        let (model, adam, mut plan) = planned(MapChange::Keep);
        let kept = apply_plan(&model, &adam, &plan);
        let texel_size = model.textures.maps[0].texel_size;
        plan.maps[0] = MapChange::Resample {
            rows: 4,
            cols: 3,
            texel_size,
            shift_texels: [0.0; 2],
            moment_scale: [1.0, 1.0],
        };
        assert_eq!(apply_plan(&model, &adam, &plan), kept);
        assert_eq!(kept, (model, adam));
    }

    #[test]
    fn scales_that_would_ruin_the_moments_are_refused() {
        let (_, _, mut plan) = planned(MapChange::Keep);
        plan.check(3).unwrap();
        for moment_scale in [[f32::NAN, 1.0], [1.0, -0.25], [f32::INFINITY, 1.0]] {
            plan.maps[0] = MapChange::Resample {
                rows: 2,
                cols: 2,
                texel_size: 0.1,
                shift_texels: [0.0; 2],
                moment_scale,
            };
            let message = plan.check(3).unwrap_err().to_string();
            assert!(message.contains("moment scale") && message.contains("new splat 0"), "{message}");
        }
    }
}
