//! Applies a density-control plan: gathers splats, changes their maps and moments, edits parameters.

use super::maps::{Outside, regrid, resample};
use crate::Result;
use crate::backend::{DensityPlan, MapChange, SplatEdit};
use crate::model::{AdamState, Model, SplatArrays, SplatGroup, TextureMap, TexturePool};
use rayon::prelude::*;

/// One of the three texel arrays.
#[derive(Clone, Copy)]
enum TexelArray {
    Values,
    FirstMoments,
    SecondMoments,
}

/// The model and optimiser state after a plan, which must have been checked.
///
/// # Errors
/// As [`TexturePool::neutral`].
pub(super) fn apply_plan(model: &Model, adam: &AdamState, plan: &DensityPlan) -> Result<(Model, AdamState)> {
    let degrees = plan.new_sh_degrees(model.splats.sh_degrees());
    let gather = |arrays: &SplatArrays| arrays.gathered(&plan.sources, degrees.clone());
    let old = &model.textures.maps;
    let maps = plan.sources.iter().zip(&plan.maps).map(|(&s, change)| change.applied_to(&old[s as usize]));
    let mut textures = TexturePool::neutral(maps)?;
    let change_all = |from: &[f32], which: TexelArray| -> Vec<f32> {
        let parts: Vec<Vec<f32>> = plan
            .sources
            .par_iter()
            .zip(&plan.maps)
            .zip(&textures.maps)
            .with_min_len(256)
            .map(|((&s, change), new)| {
                let old = &old[s as usize];
                changed(old, &from[old.floats()], new, change, which)
            })
            .collect();
        parts.concat()
    };
    let texels = change_all(&model.textures.texels, TexelArray::Values);
    let texels_m = change_all(&adam.texels_m, TexelArray::FirstMoments);
    let texels_v = change_all(&adam.texels_v, TexelArray::SecondMoments);
    textures.texels = texels;
    let mut adam = AdamState {
        splats_m: gather(&adam.splats_m),
        splats_v: adam.splats_v.gathered_second_moments(&plan.sources, degrees.clone()),
        texels_m,
        texels_v,
        last_step: plan.sources.iter().map(|&s| adam.last_step[s as usize]).collect(),
        ..*adam
    };
    let mut model = Model { splats: gather(&model.splats), textures, ..*model };
    plan.edits.iter().for_each(|edit| apply_edit(edit, &mut model.splats, &mut adam.splats_m));
    Ok((model, adam))
}

/// The values of a map in one of the arrays after its change.
fn changed(
    old: &TextureMap,
    from: &[f32],
    new: &TextureMap,
    change: &MapChange,
    which: TexelArray,
) -> Vec<f32> {
    let (mut out, moment_scale) = match *change {
        MapChange::Keep => return from.to_vec(),
        MapChange::Resample { shift_texels, moment_scale, .. } => {
            (resample(old, from, new, shift_texels), moment_scale)
        }
        MapChange::Regrid { grids, first_row, first_col, moment_scale, .. } => {
            let outside = match which {
                TexelArray::Values | TexelArray::FirstMoments => Outside::Zero,
                TexelArray::SecondMoments => Outside::Nearest,
            };
            (regrid(old, from, new, grids, [first_row, first_col], outside), moment_scale)
        }
    };
    let factor = match which {
        TexelArray::Values => return out,
        TexelArray::FirstMoments => moment_scale[0],
        TexelArray::SecondMoments => moment_scale[1],
    };
    out.iter_mut().for_each(|value| *value *= factor);
    out
}

/// Writes the edited parameters, and zeroes the first moments of all parameters of the splat.
fn apply_edit(edit: &SplatEdit, splats: &mut SplatArrays, first_moments: &mut SplatArrays) {
    let i = edit.splat as usize;
    splats.positions[3 * i..3 * i + 3].copy_from_slice(&edit.position);
    splats.log_scales[2 * i..2 * i + 2].copy_from_slice(&edit.log_scales);
    splats.opacity_logits[i] = edit.opacity_logit;
    for group in SplatGroup::ALL {
        let range = first_moments.range(group, i);
        first_moments.group_mut(group)[range].fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::Grid;
    use crate::selftest::{SceneOptions, random_scene};

    fn apply_plan(model: &Model, adam: &AdamState, plan: &DensityPlan) -> (Model, AdamState) {
        super::apply_plan(model, adam, plan).unwrap()
    }

    /// A small model with irregular moments, and a plan that makes `change` to its first map.
    fn planned(change: MapChange) -> (Model, AdamState, DensityPlan) {
        let options = SceneOptions { num_splats: 3, map_sizes: vec![(4, 3)], ..SceneOptions::default() };
        let mut model = random_scene(&options).model;
        model.splats.set_sh_degrees(&[3; 3]);
        let mut adam = AdamState::zeros(&model);
        adam.texels_m.iter_mut().enumerate().for_each(|(i, m)| *m = 0.1 * (i as f32).sin());
        adam.texels_v.iter_mut().enumerate().for_each(|(i, v)| *v = 0.01 * (i as f32).cos().abs());
        adam.splats_m.positions.fill(0.3);
        let maps = vec![change, MapChange::Keep, MapChange::Keep];
        (model, adam, DensityPlan { sources: vec![0, 1, 2], maps, ..DensityPlan::default() })
    }

    #[test]
    fn resampling_scales_the_moments_and_nothing_else() {
        // Twice as many texels per axis; then the same grid, which is copied.
        for (rows, cols, finer) in [(8, 6, 0.5), (4, 3, 1.0)] {
            let run = |moment_scale| {
                let (model, adam, mut plan) = planned(MapChange::Keep);
                let texel_sizes = model.textures.maps[0].texel_sizes.map(|size| finer * size);
                plan.maps[0] =
                    MapChange::Resample { rows, cols, texel_sizes, shift_texels: [0.0; 2], moment_scale };
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
            // Kept maps and the splats' moments do not change.
            assert_eq!(adam.texels_m[first.end..], plain.texels_m[first.end..]);
            assert_eq!(adam.texels_v[first.end..], plain.texels_v[first.end..]);
            assert_eq!((&adam.splats_m, &adam.splats_v), (&plain.splats_m, &plain.splats_v));
            // Negative control: exchanged factors change both moments.
            let (_, exchanged) = run([0.0625, 0.25]);
            assert!(exchanged.texels_m != adam.texels_m && exchanged.texels_v != adam.texels_v);
        }
    }

    #[test]
    fn resampling_to_the_same_grid_keeps_every_bit() {
        let (model, adam, mut plan) = planned(MapChange::Keep);
        let kept = apply_plan(&model, &adam, &plan);
        let texel_sizes = model.textures.maps[0].texel_sizes;
        plan.maps[0] = MapChange::Resample {
            rows: 4,
            cols: 3,
            texel_sizes,
            shift_texels: [0.0; 2],
            moment_scale: [1.0, 1.0],
        };
        assert_eq!(apply_plan(&model, &adam, &plan), kept);
        assert_eq!(kept, (model, adam));
    }

    #[test]
    fn invalid_moment_scales_are_refused() {
        let (_, _, mut plan) = planned(MapChange::Keep);
        plan.check(3).unwrap();
        for moment_scale in [[f32::NAN, 1.0], [1.0, -0.25], [f32::INFINITY, 1.0]] {
            plan.maps[0] = MapChange::Resample {
                rows: 2,
                cols: 2,
                texel_sizes: [0.1; 2],
                shift_texels: [0.0; 2],
                moment_scale,
            };
            let message = plan.check(3).unwrap_err().to_string();
            assert!(message.contains("moment scale") && message.contains("new splat 0"), "{message}");
        }
    }

    fn window(grids: [Grid; 2], size: [u16; 2], first: [i32; 2]) -> MapChange {
        let ([rows, cols], [first_row, first_col]) = (size, first);
        MapChange::Regrid {
            grids,
            rows,
            cols,
            first_row,
            first_col,
            shift: [1, -2],
            moment_scale: [0.25, 0.0625],
        }
    }

    #[test]
    fn padding_uses_zeros_for_texels_and_nearest_second_moments() {
        // Adds a column on each side of the first map, which is 4 x 3.
        let (model, adam, plan) = planned(window([Grid::Same; 2], [4, 5], [0, -1]));
        plan.check(3).unwrap();
        let (new, moments) = apply_plan(&model, &adam, &plan);
        assert_eq!(new.textures.maps[0].num_texels(), 20);
        assert_eq!(new.textures.maps[0].texel_sizes, model.textures.maps[0].texel_sizes);
        assert_eq!(new.textures.maps[0].shift, [1, -2]);
        for (t, before) in (0..20).map(|t: usize| (t, 3 * (t / 5 * 3 + (t % 5).clamp(1, 3) - 1))) {
            let padding = t % 5 == 0 || t % 5 == 4;
            for c in 0..3 {
                let texel = if padding { 0.0 } else { model.textures.texels[before + c] };
                let first = if padding { 0.0 } else { 0.25 * adam.texels_m[before + c] };
                assert_eq!(new.textures.texels[3 * t + c], texel, "texel {t}");
                assert_eq!(moments.texels_m[3 * t + c], first, "texel {t}");
                assert_eq!(moments.texels_v[3 * t + c], 0.0625 * adam.texels_v[before + c], "texel {t}");
            }
        }
        // The other maps and all splats are unchanged.
        assert_eq!(new.textures.texels[60..], model.textures.texels[36..]);
        assert_eq!((&new.splats, &moments.splats_m), (&model.splats, &adam.splats_m));
        // A finer grid halves the edge along its axis; a window without texels drops the map.
        let (model, adam, plan) = planned(window([Grid::Finer, Grid::Same], [8, 3], [0, 0]));
        let (new, _) = apply_plan(&model, &adam, &plan);
        let [u, v] = model.textures.maps[0].texel_sizes;
        assert_eq!(new.textures.maps[0].texel_sizes, [0.5 * u, v]);
        let (_, _, plan) = planned(window([Grid::Same; 2], [0, 0], [0, 0]));
        plan.check(3).unwrap();
        assert_eq!(apply_plan(&model, &adam, &plan).0.num_texels(), model.num_texels() - 12);
    }

    #[test]
    fn a_window_with_texels_along_only_one_axis_is_refused() {
        for (size, first) in [([0, 3], [0, 0]), ([4, 0], [0, 0])] {
            let (_, _, plan) = planned(window([Grid::Same; 2], size, first));
            let message = plan.check(3).unwrap_err().to_string();
            assert!(message.contains("new splat 0") && message.contains("texels"), "{message}");
        }
    }

    #[test]
    fn edits_write_parameters_and_zero_the_first_moments_of_their_splat_only() {
        let (model, mut adam, mut plan) = planned(MapChange::Keep);
        for (k, group) in SplatGroup::ALL.into_iter().enumerate() {
            adam.splats_m.group_mut(group).fill(0.1 + k as f32);
            adam.splats_v.group_mut(group).fill(0.01 + k as f32);
        }
        let edit = |splat, x| SplatEdit {
            splat,
            position: [x, 2.0, 3.0],
            log_scales: [-1.0, -2.0],
            opacity_logit: 0.5,
        };
        plan.sources = vec![2, 0, 0];
        let (before, _) = apply_plan(&model, &adam, &plan);
        plan.edits = vec![edit(1, 7.0), edit(2, 8.0)];
        plan.check(3).unwrap();
        let (after, moments) = apply_plan(&model, &adam, &plan);
        assert_eq!(after.splats.positions[3..], [7.0, 2.0, 3.0, 8.0, 2.0, 3.0]);
        assert_eq!(after.splats.log_scales[2..], [-1.0, -2.0, -1.0, -2.0]);
        assert_eq!(after.splats.opacity_logits[1..], [0.5, 0.5]);
        assert_eq!(after.splats.positions[..3], before.splats.positions[..3]);
        assert_eq!(after.splats.quaternions, before.splats.quaternions);
        assert_eq!(after.splats.sh, before.splats.sh);
        assert_eq!(after.textures, before.textures);
        for group in SplatGroup::ALL {
            let width = group.width(if group == SplatGroup::Sh { 3 } else { 0 });
            let (m, v) = (moments.splats_m.group(group), moments.splats_v.group(group));
            // Negative control: the splat that is not edited keeps its first moments.
            assert!(m[..width].iter().all(|m| *m != 0.0), "{group:?}");
            assert!(m[width..].iter().all(|m| *m == 0.0), "{group:?}");
            assert_eq!(v, adam.splats_v.group(group), "{group:?}");
        }
        // Edits do not touch the texels' moments: 36 floats per map, one of them zero in each copy of the first map.
        assert_eq!(moments.texels_m.iter().filter(|m| **m != 0.0).count(), 36 * 3 - 2);
    }

    #[test]
    fn edits_out_of_order_or_range_are_refused() {
        let (_, _, mut plan) = planned(MapChange::Keep);
        let edit = |splat, opacity_logit| SplatEdit {
            splat,
            position: [0.0; 3],
            log_scales: [0.0; 2],
            opacity_logit,
        };
        for edits in [vec![edit(3, 0.0)], vec![edit(1, 0.0), edit(1, 0.0)], vec![edit(0, f32::NAN)]] {
            plan.edits = edits;
            assert!(plan.check(3).unwrap_err().to_string().contains("edit"));
        }
    }
}
