//! Splats: pruned, split, respawned.

use super::*;
use crate::backend::{Backend, DensityPlan, RenderOptions};
use crate::camera::{Pinhole, RigidTransform};
use crate::cpu::CpuBackend;
use crate::model::{AdamState, SplatArrays};
use crate::train::density::ops::split::split_any;
use crate::train::density::plan::{Plan, PlannedSplat};
use crate::train::density::sizes::Sizes;
use glam::{DMat3, DVec3};

#[test]
fn splats_are_pruned_after_consecutive_useless_checks_and_unseen_ones_are_kept() {
    let (model, cameras) = (model(2), [camera()]);
    let (mut histories, config) = (vec![SplatHistory::first(2); N], settings());
    // Splat 0 is always useless, 1 is useful once, 2 is never seen, 3 is unseen once.
    for check in 0..5 {
        let mut statistics = window([0.3; N]);
        for i in 0..4 {
            let useless = i != 1 || check != 2;
            if useless {
                (statistics.area[i], statistics.contribution[i]) = (0.0, 0.0);
            }
            statistics.seen[i] = u32::from(!(i == 2 || i == 3 && check == 1));
        }
        let s = situation(&model, &histories, &statistics, &cameras, &config);
        let revision = litetex::revise(&Situation { timing: Timing { patience: 4, ..TIMING }, ..s });
        let removed = |i: u32| revision.plan.as_ref().is_some_and(|p| !p.sources.contains(&i));
        assert_eq!([0, 1, 2].map(removed), [check >= 3, false, false], "check {check}");
        if check == 3 {
            assert!(!removed(3), "unseen in one of the four checks");
            // The revision's histories have no splat 0, so the old ones are kept, with the new prune count of 3.
            histories[3].prune_count = 3;
            continue;
        }
        if check < 3 {
            histories = revision.histories;
        } else {
            assert!(removed(3), "useless in four checks");
        }
    }
}

#[test]
fn halves_lie_on_the_parents_grid() {
    let (model, cameras, statistics) = (model(16), [camera()], one_high_error());
    let histories = vec![SplatHistory::first(64); N];
    let config = DensityConfig { coarsen_below: 0.0, ..settings() };
    let s = situation(&model, &histories, &statistics, &cameras, &config);
    let long = |texels| Timing { split_texels: Some(texels), ..TIMING };
    // Drawn: more often what removes more error per parameter, here the split.
    let drawn = |seed| {
        let counts = litetex::revise(&Situation { timing: long(8.0), seed, ..s }).counts;
        assert_eq!(counts.split + counts.refined, 1);
        counts.split
    };
    let splits: usize = (0..100).map(drawn).sum();
    // Refining its map of 16 x 16 costs many times more.
    assert!(splits > 90, "{splits}");
    assert_eq!(litetex::revise(&s).counts.split, 0, "it is not long");
    // The tight profile shifts by less than the grid allows on this map and would resample.
    let revision = revise_as_paper(&Situation { timing: long(16.0), ..s });
    let plan = revision.plan.unwrap();
    assert_eq!((plan.sources.len(), plan.edits.len(), revision.counts.split), (N + 1, 2, 1));
    let parent = &model.textures.maps[5];
    let mut shifts = Vec::new();
    for edit in &plan.edits {
        let i = edit.splat as usize;
        assert_eq!(plan.sources[i], 5);
        assert!(revision.histories[i].is_fresh());
        assert_eq!(revision.histories[i].ceiling, 128, "the ceiling of every candidate doubles");
        let MapChange::Regrid { grids, rows, cols, first_row, first_col, shift, moment_scale } = plan.maps[i]
        else {
            panic!("{:?}", plan.maps[i])
        };
        assert_eq!((grids, shift), ([Grid::Same; 2], [0; 2]));
        assert_eq!(moment_scale[0], 0.0, "first moments start at zero");
        // The window's centre is shifted by whole texels, and by as much as the splat's centre.
        let by =
            |first: i32, new: u16, old: u16| f64::from(2 * first + i32::from(new) - i32::from(old)) / 2.0;
        let (u, v) = (by(first_row, rows, parent.rows), by(first_col, cols, parent.cols));
        assert!((u == 0.0) != (v == 0.0) && u.fract() == 0.0 && v.fract() == 0.0, "{u} {v}");
        let old = &model.splats.positions[15..18];
        let distance: f64 = (0..3).map(|k| f64::from(edit.position[k] - old[k]).powi(2)).sum::<f64>().sqrt();
        let texels = distance / f64::from(parent.texel_sizes[0]);
        assert!((texels - (u + v).abs()).abs() < 1e-3, "{texels} {u} {v}");
        shifts.push(u + v);
    }
    assert_eq!(shifts[0], -shifts[1]);
}

#[test]
fn fresh_halves_survive_two_checks() {
    let (model, cameras, config) = (model(2), [camera()], settings());
    // The first three splats are `checks` old; a prune count of one removes.
    let survivors = |model: &Model, statistics: &WindowStatistics, checks: u16| {
        let young = |i: usize| {
            if i < 3 { SplatHistory { checks, ..SplatHistory::first(2) } } else { SplatHistory::first(2) }
        };
        let histories: Vec<SplatHistory> = (0..N).map(young).collect();
        let s = situation(model, &histories, statistics, &cameras, &config);
        let timing = Timing { patience: 1, grows: false, ..TIMING };
        let Revision { plan, histories, .. } = revise_as_paper(&Situation { timing, ..s });
        let mut left: Vec<(u32, u16)> = plan
            .unwrap()
            .sources
            .into_iter()
            .zip(histories.iter().map(|history| history.prune_count))
            .collect();
        left.sort_unstable();
        left
    };
    let fresh_and_last = [(0, 0), (1, 0), (2, 0), (11, 0)];
    // Only the last splat is useful.
    let mut useless = window([0.3; N]);
    useless.area[..N - 1].fill(0.0);
    useless.contribution[..N - 1].fill(0.0);
    // All but the last have an opacity of 0.012, between the floors of fresh and of other splats.
    let mut faint = model.clone();
    faint.splats.opacity_logits[..N - 1].fill(-4.4);
    for checks in [0, 1] {
        assert_eq!(survivors(&model, &useless, checks), fresh_and_last, "{checks} checks");
        assert_eq!(survivors(&faint, &window([0.3; N]), checks), fresh_and_last, "{checks} checks");
    }
    // Negative controls: splats that are no longer fresh, and fresh ones below their floor.
    assert_eq!(survivors(&model, &useless, 2), fresh_and_last[3..]);
    assert_eq!(survivors(&faint, &window([0.3; N]), 2), fresh_and_last[3..]);
    faint.splats.opacity_logits[..N - 1].fill(-5.0);
    assert_eq!(survivors(&faint, &window([0.3; N]), 0), fresh_and_last[3..]);
}

#[test]
fn pruned_splats_are_respawned_where_the_error_is() {
    let (mut model, cameras) = (model(2), [camera()]);
    model.splats.opacity_logits[..3].fill(-6.0);
    let errors = std::array::from_fn(|i| 0.1 + 0.05 * i as f32);
    // All maps are at their ceilings, so that only splits are possible.
    let (statistics, histories) = (window(errors), vec![SplatHistory::first(2); N]);
    let config = DensityConfig { quantile: 0.1, ..settings() };
    let revised = |initial_splats: usize, is_paper: bool, budget: Budget| {
        let s = situation(&model, &histories, &statistics, &cameras, &config);
        let s = Situation { initial_splats, texture_cap: 2, budget, ..s };
        let Revision { plan, counts, .. } = if is_paper { revise_as_paper(&s) } else { litetex::revise(&s) };
        let plan = plan.unwrap();
        for edit in &plan.edits {
            let parent = plan.sources[edit.splat as usize] as usize;
            let old = &model.splats.log_scales[2 * parent..2 * parent + 2];
            let narrower = [0, 1].map(|a| (old[a] - edit.log_scales[a]).exp());
            let [_, factor, _] = Profile::Tight.factors();
            let halved = narrower.map(|n| (f64::from(n) * factor - 1.0).abs() < 1e-5);
            assert!(halved[0] != halved[1], "{narrower:?} times narrower than the parent");
        }
        (plan.sources.len(), counts.faded, counts.respawned, counts.split)
    };
    let none = Budget::default();
    assert_eq!(revised(N, false, none), (N, 3, 3, 0));
    assert_eq!(revised(N - 2, false, none), (N - 2, 3, 1, 0), "no more than initially");
    let tight = Budget { max_splats: Some(N - 1), ..none };
    assert_eq!(revised(N, false, tight).0, N - 1, "a budget comes first");
    // Negative control: the published method.
    assert_eq!(revised(N, true, none), (N - 3, 3, 0, 0));
}

/// How far the halves of a splat of this opacity are from it in the image, relative to what it adds to the image: over a
/// background, or over another splat too.
fn deviation_of_halves(opacity: f32, over_a_splat: bool, profile: Profile) -> f64 {
    let mut splats = SplatArrays::zeros(2, 0);
    splats.positions = vec![0.0, 0.0, 1.0, 0.1, 0.05, 1.3];
    splats.quaternions = [1.0, 0.0, 0.0, 0.0].repeat(2);
    splats.log_scales = [0.2_f32, 0.1, 0.15, 0.2].map(f32::ln).to_vec();
    let logit = |opacity: f32| (opacity / (1.0 - opacity)).ln();
    splats.opacity_logits = vec![logit(opacity), if over_a_splat { logit(0.8) } else { -20.0 }];
    splats.sh_of_mut(0).copy_from_slice(&[1.5, 0.0, -1.0]);
    splats.sh_of_mut(1).copy_from_slice(&[-1.0, 1.0, 0.5]);
    let textures = TexturePool::neutral([TextureMap::square(0, 0, 0.01); 2]).unwrap();
    let model = Model { textures, splats, ..scene().model };
    let (statistics, history, config) = (window([0.0; N]), SplatHistory::first(64), settings());
    let s = situation(&model, &[], &statistics, &[], &config);
    let planned = |source| PlannedSplat {
        source,
        change: MapChange::Keep,
        edit: None,
        history,
        sizes: Sizes::default(),
        texels: 0,
        sh_degree: 0,
    };
    let mut plan = Plan::new(vec![Some(planned(0)), Some(planned(1))], s.bound());
    assert!(plan.replace(0, &split_any(&s, profile, &planned(0))));
    let halved = plan.finish(&model, DensityCounts::default()).plan.unwrap();

    let pinhole = Pinhole { width_px: 96, height_px: 96, fx_px: 90.0, fy_px: 90.0, cx_px: 48.0, cy_px: 48.0 };
    let camera_from_local = RigidTransform { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };
    let camera = Camera { pinhole, camera_from_local };
    let mut backend = CpuBackend::new(Some(1)).unwrap();
    let mut image = |model: &Model, plan: Option<&DensityPlan>| {
        backend.upload(model, &AdamState::zeros(model)).unwrap();
        plan.map_or(Ok(()), |plan| backend.apply_plan(plan)).unwrap();
        let options = RenderOptions { background: [0.2, 0.5, 0.4], sh_degree: 0, geometry: false };
        backend.render(&camera, &options).unwrap().rgb
    };
    let mut without = model.clone();
    without.splats.opacity_logits[0] = -20.0;
    let whole = image(&model, None);
    let distance =
        |other: Vec<f32>| other.iter().zip(&whole).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt();
    distance(image(&model, Some(&halved))) / distance(image(&without, None))
}

#[test]
fn halves_look_like_the_whole_over_a_background_and_over_another_splat() {
    for over_a_splat in [false, true] {
        for opacity in [0.1, 0.5, 0.9] {
            let tight = deviation_of_halves(opacity, over_a_splat, Profile::Tight);
            assert!(tight < 0.21, "{opacity} {over_a_splat}: {tight}"); // needed 0.20
            // Negative control: the published halves.
            let published = deviation_of_halves(opacity, over_a_splat, Profile::Paper);
            assert!(published > 0.5, "{opacity} {over_a_splat}: {published}");
        }
    }
}
