//! Maps: fitted, coarsened, refined along an axis.

use super::*;

#[test]
fn maps_follow_their_support_without_moving_a_texel() {
    let (mut model, cameras, statistics) = (model(8), [camera()], window([0.3; N]));
    model.splats.log_scales[6] -= 0.7;
    model.splats.log_scales[7] -= 0.7;
    let histories = vec![SplatHistory::first(64); N];
    let config = DensityConfig { coarsen_below: 0.0, ..settings() };
    let plan = litetex::revise(&situation(&model, &histories, &statistics, &cameras, &config)).plan.unwrap();
    for (i, change) in plan.maps.iter().enumerate() {
        let map = &model.textures.maps[i];
        match *change {
            MapChange::Regrid {
                grids: [Grid::Same, Grid::Same], rows, cols, first_row, first_col, ..
            } if i == 3 => {
                assert_eq!(2 * first_row + i32::from(rows), i32::from(map.rows), "same centre");
                assert_eq!(2 * first_col + i32::from(cols), i32::from(map.cols), "same centre");
                assert!(rows < map.rows && cols < map.cols);
            }
            MapChange::Keep if i != 3 => {}
            _ => panic!("{i}: {change:?}"),
        }
    }
}

#[test]
fn only_smooth_maps_are_coarsened() {
    let (mut model, cameras, statistics) = (model(8), [camera()], window([0.3; N]));
    let histories = vec![SplatHistory::first(64); N];
    let smooth = model.textures.maps[4].floats();
    model.textures.texels[smooth].fill(0.01);
    let config = settings();
    let s = situation(&model, &histories, &statistics, &cameras, &config);
    let plan = litetex::revise(&s).plan.unwrap();
    for (i, change) in plan.maps.iter().enumerate() {
        let is_coarser = matches!(change, MapChange::Regrid { grids: [Grid::Coarser, Grid::Coarser], .. });
        assert_eq!(is_coarser, i == 4, "{i}: {change:?}");
    }
    let late = Situation { timing: Timing { may_coarsen: false, ..TIMING }, ..s };
    assert!(litetex::revise(&late).plan.is_none());
}

#[test]
fn maps_are_refined_along_the_axis_on_which_they_vary_and_coarsened_along_the_other() {
    let (mut model, cameras, statistics) = (model(8), [camera()], one_high_error());
    let histories = vec![SplatHistory::first(256); N];
    // Stripes along one axis on the splat of a high error, and on one whose map may be coarsened.
    for (splat, period) in [(4, 4), (5, 1)] {
        let map = model.textures.maps[splat];
        let texels = &mut model.textures.texels[map.floats()];
        for (t, rgb) in texels.chunks_exact_mut(3).enumerate() {
            rgb.fill(if t % usize::from(map.cols) / period % 2 == 0 { 0.8 } else { -0.8 });
        }
    }
    let grids = |factor: f64| {
        let config = DensityConfig { grow_by_axis: factor, min_texel_px: 0.2, ..settings() };
        let plan =
            litetex::revise(&situation(&model, &histories, &statistics, &cameras, &config)).plan.unwrap();
        [4, 5].map(|splat| match plan.maps[splat] {
            MapChange::Regrid { grids, moment_scale, .. } => (grids, moment_scale),
            _ => ([Grid::Same; 2], [1.0; 2]),
        })
    };
    let (same, finer, coarser) = (Grid::Same, Grid::Finer, Grid::Coarser);
    assert_eq!(grids(4.0), [([coarser, same], [2.0, 4.0]), ([same, finer], [0.5, 0.25])]);
    // Negative control: both axes or none.
    assert_eq!(grids(0.0), [([same; 2], [1.0; 2]), ([finer; 2], [0.25, 0.0625])]);
}

#[test]
fn without_statistics_maps_are_only_fitted_to_their_support() {
    let (mut model, cameras, mut statistics) = (model(8), [camera()], one_high_error());
    // Splat 3 has shrunk, splat 4 has widened.
    model.splats.log_scales[6..8].iter_mut().for_each(|s| *s -= 0.7);
    model.splats.log_scales[8..10].iter_mut().for_each(|s| *s += 0.3);
    // Others have faded, are useless or have an unneeded map; splat 5 has a high error.
    model.splats.opacity_logits[0] = -6.0;
    (statistics.area[1], statistics.contribution[1]) = (0.0, 0.0);
    let smooth = model.textures.maps[2].floats();
    model.textures.texels[smooth].fill(0.01);
    let histories = vec![SplatHistory::first(64); N];
    let config = settings();
    let revise = |use_statistics| {
        let s = situation(&model, &histories, &statistics, &cameras, &config);
        litetex::revise(&Situation {
            timing: Timing { patience: 1, use_statistics, grows: use_statistics, ..TIMING },
            ..s
        })
    };
    let revision = revise(false);
    let plan = revision.plan.unwrap();
    assert_eq!((plan.sources, plan.edits.len()), ((0..N as u32).collect::<Vec<_>>(), 0));
    assert!(revision.histories == histories && revision.counts == DensityCounts::default());
    for (i, (change, map)) in plan.maps.iter().zip(&model.textures.maps).enumerate() {
        match *change {
            MapChange::Keep if ![3, 4].contains(&i) => {}
            MapChange::Regrid {
                grids: [Grid::Same, Grid::Same],
                rows,
                cols,
                moment_scale: [1.0, 1.0],
                ..
            } => {
                let texels = [rows, cols, map.rows, map.cols].map(usize::from);
                let more = texels[0] * texels[1] > texels[2] * texels[3];
                assert!(i == 3 && !more || i == 4 && more, "{i}: {change:?}");
            }
            _ => panic!("{i}: {change:?}"),
        }
    }
    // Negative control: with statistics all of it is done.
    let counts = revise(true).counts;
    assert_eq!([counts.faded, counts.pruned, counts.coarsened, counts.refined], [1; 4], "{counts:?}");
}

#[test]
fn maps_cropped_by_pruning_are_not_padded_again() {
    let (mut model, cameras, statistics) = (model(8), [camera()], window([0.3; N]));
    // One side is gone, as after a round of pruning; splat 4 has widened since, splat 5 has shrunk.
    for map in &mut model.textures.maps {
        *map = cropped(map, [[3, 0], [0, 0]]).applied_to(map);
    }
    model.textures = TexturePool::neutral(model.textures.maps).expect("room");
    model.textures.texels.iter_mut().enumerate().for_each(|(i, t)| *t = (i as f32 * 0.7).sin());
    model.splats.log_scales[8..10].iter_mut().for_each(|s| *s += 0.3);
    model.splats.log_scales[10..12].iter_mut().for_each(|s| *s -= 0.4);
    let histories = vec![SplatHistory::first(64); N];
    // The first and the last edges of the maps of some splats, in half texels from their centres.
    let edges = |model: &Model, maps: &[MapChange], splats: &[usize]| -> Vec<[[i32; 2]; 2]> {
        let edges = |&splat: &usize| {
            let map = maps[splat].applied_to(&model.textures.maps[splat]);
            [0, 1].map(|axis| {
                [-1, 1].map(|end| i32::from(map.shift[axis]) + end * i32::from([map.rows, map.cols][axis]))
            })
        };
        splats.iter().map(edges).collect()
    };
    for use_statistics in [false, true] {
        let fitted = |may_pad: bool| {
            let config = DensityConfig { coarsen_below: 0.0, ..settings() };
            let timing = Timing { grows: false, use_statistics, may_pad, ..TIMING };
            let s = situation(&model, &histories, &statistics, &cameras, &config);
            litetex::revise(&Situation { timing, ..s })
                .plan
                .map_or_else(|| vec![MapChange::Keep; N], |plan| plan.maps)
        };
        let maps = fitted(false);
        assert!(
            maps.iter().enumerate().all(|(splat, map)| (*map == MapChange::Keep) != (splat == 5)),
            "{maps:?}"
        );
        // What has shrunk is cropped where it sticks out, about the splat's centre.
        let [[first_u, last_u], [first_v, last_v]] = edges(&model, &maps, &[5])[0];
        let [[held_u, _], [held_v, _]] = edges(&model, &[MapChange::Keep; N], &[5])[0];
        assert!(first_u >= held_u && -first_v == last_v && first_v > held_v && last_u == last_v);
        // Negative control: before the first round all are padded to cover their support about its centre.
        let padded = fitted(true);
        let is_centred = |[[a, b], [c, d]]: &[[i32; 2]; 2]| a == &-b && c == &-d;
        let all: Vec<usize> = (0..N).collect();
        assert!(edges(&model, &padded, &all).iter().all(is_centred), "{padded:?}");
    }
}

#[test]
fn maps_beside_their_support_keep_a_texel() {
    let map = |shift: i16, rows: u16| TextureMap { shift: [shift, 0], ..TextureMap::square(rows, 4, 1.0) };
    let kept = |map: TextureMap, needed: [u32; 2]| {
        let kept = cropped(&map, surplus(&map, needed)).applied_to(&map);
        (kept.rows, kept.cols, kept.shift[0])
    };
    // Of rows from 3 to 6 texels from the centre, the nearest; of those from -2 to 1, those from -1.
    assert_eq!(kept(map(9, 3), [4, 2]), (1, 2, 7));
    assert_eq!(kept(map(-9, 3), [4, 2]), (1, 2, -7));
    assert_eq!(kept(map(-1, 3), [2, 8]), (2, 4, 0));
    // Negative control: all are inside.
    assert_eq!(kept(map(-1, 3), [4, 4]), (3, 4, -1));
}
