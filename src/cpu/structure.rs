//! Applies a structure plan: gathers splats, keeps or resamples their maps and moments.

use crate::backend::{MapChange, StructurePlan};
use crate::model::{AdamState, Model, SplatArrays, TextureMap, TexturePool};
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
        MapChange::Resample { rows, cols, texel_size } => (rows, cols, texel_size),
    });
    let mut textures = TexturePool::neutral(extents);
    let resample_all = |from: &[f32]| -> Vec<f32> {
        let parts: Vec<Vec<f32>> = plan
            .sources
            .par_iter()
            .zip(&textures.maps)
            .with_min_len(256)
            .map(|(&s, new)| resample(&old[s as usize], &from[old[s as usize].floats()], new))
            .collect();
        parts.concat()
    };
    let texels = resample_all(&model.textures.texels);
    let texels_m = resample_all(&adam.texels_m);
    let texels_v = resample_all(&adam.texels_v);
    textures.texels = texels;
    let adam = AdamState {
        splats_m: gather(&adam.splats_m),
        splats_v: gather(&adam.splats_v),
        texels_m,
        texels_v,
        last_step: plan.sources.iter().map(|&s| adam.last_step[s as usize]).collect(),
        ..*adam
    };
    let model = Model { splats: gather(&model.splats), textures, ..*model };
    (model, adam)
}

/// Bilinear resampling about the common centre; zero outside the old map.
fn resample(old: &TextureMap, from: &[f32], new: &TextureMap) -> Vec<f32> {
    if (old.rows, old.cols, old.texel_size) == (new.rows, new.cols, new.texel_size) {
        return from.to_vec();
    }
    let ratio = new.texel_size / old.texel_size;
    let coordinate = |i: u16, size: u16, old_size: u16| {
        (f32::from(i) - (f32::from(size) - 1.0) / 2.0) * ratio + (f32::from(old_size) - 1.0) / 2.0
    };
    let texel = |row: i32, col: i32, c: usize| {
        let inside = row >= 0 && row < i32::from(old.rows) && col >= 0 && col < i32::from(old.cols);
        if inside { from[3 * (row * i32::from(old.cols) + col) as usize + c] } else { 0.0 }
    };
    let mut out = Vec::with_capacity(3 * new.num_texels());
    for i in 0..new.rows {
        let u = coordinate(i, new.rows, old.rows);
        let (row, fu) = (u.floor() as i32, u - u.floor());
        for j in 0..new.cols {
            let v = coordinate(j, new.cols, old.cols);
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

    #[test]
    fn resampling_a_linear_map_is_exact_inside_and_zero_far_outside() {
        let old = map(6, 5, 0.1);
        let from: Vec<f32> = (0..30).flat_map(|t| [(t / 5) as f32, (t % 5) as f32, 1.0]).collect();
        let new = map(4, 3, 0.05);
        let got = resample(&old, &from, &new);
        for (t, rgb) in got.chunks_exact(3).enumerate() {
            let u = (t / 3) as f32 * 0.5 - 0.75 + 2.5;
            let v = (t % 3) as f32 * 0.5 - 0.5 + 2.0;
            assert!((rgb[0] - u).abs() < 1e-5 && (rgb[1] - v).abs() < 1e-5 && rgb[2] == 1.0, "{t}: {rgb:?}");
        }
        let wide = resample(&old, &from, &map(20, 20, 0.1));
        assert_eq!(&wide[..3], &[0.0; 3]);
        assert_eq!(resample(&old, &from, &old), from);
    }
}
