//! Revisions of small models: what is pruned, split, refined and coarsened.

use super::decide::decide;
use super::geometry::{even_texels, first_texel_size, half_extents, opacity, sigmas};
use super::growth::Growth;
use super::history::{SplatHistory, Trial};
use super::regrid::{cropped, surplus};
use super::settings::{Budget, Components, DensityConfig, Spending, SplitProfile};
use super::situation::{DensityCounts, Revision, Situation};
use super::sizes::MapRule;
use crate::backend::{Grid, MapChange, WindowStatistics};
use crate::camera::Camera;
use crate::constants::{ALPHA_MIN, sh_coefficients};
use crate::model::{Model, ModelSize, TextureMap, TexturePool};
use crate::selftest::{RandomScene, SceneOptions, random_scene};

const N: usize = 12;

/// Splats at a depth of about 1, with maps of `texels` per side that fit their support.
fn model(texels: u16) -> Model {
    let mut model = scene().model;
    let extents = (0..N).map(|i| {
        let half = half_extents(sigmas(&model, i), opacity(&model, i), ALPHA_MIN);
        let size = first_texel_size(half) / f64::from(texels - 1);
        let [rows, cols] = half.map(|h| even_texels(h, size) as u16);
        TextureMap::square(rows, cols, size as f32)
    });
    model.textures = TexturePool::neutral(extents.collect::<Vec<_>>()).unwrap();
    model.textures.texels.iter_mut().enumerate().for_each(|(i, t)| *t = (i as f32 * 0.7).sin());
    model
}

/// Maps as wide as the support, like those of the models here.
fn settings() -> DensityConfig {
    DensityConfig { alpha_texture: ALPHA_MIN, quantile: 0.85, ..DensityConfig::default() }
}

fn scene() -> RandomScene {
    random_scene(&SceneOptions {
        num_splats: N,
        map_sizes: vec![(2, 2)],
        scales: (0.1, 0.11),
        opacities: (0.5, 0.6),
        depths: (0.9, 1.1),
        ..SceneOptions::default()
    })
}

fn camera() -> Camera {
    scene().camera
}

/// A window in which every splat is visible and useful, with these errors.
fn window(errors: [f32; N]) -> WindowStatistics {
    WindowStatistics {
        views: 1,
        seen: vec![1; N],
        area: vec![0.1; N],
        contribution: vec![0.1; N],
        error: errors.map(|e| 0.1 * e).to_vec(),
    }
}

fn situation<'a>(
    model: &'a Model,
    histories: &'a [SplatHistory],
    statistics: &'a WindowStatistics,
    cameras: &'a [Camera],
) -> Situation<'a> {
    Situation {
        model,
        histories,
        statistics,
        cameras,
        render_scale: 1.0,
        texture_cap: 256,
        densify: true,
        use_statistics: true,
        may_coarsen: true,
        may_pad: true,
        sh_tested: 0,
        sh_trial_checks: 0,
        sh_highest: 3,
        texels_trained: true,
        growth: Growth::default(),
        step: 1,
        seed: 0,
        draws_splits: false,
        max_added: 100,
        initial_splats: 0,
        split_texels: 1000.0,
        patience: 8,
        opacity_floor: 0.02,
        rule: MapRule::Adaptive,
    }
}

/// Size of the model after a revision.
fn size_after(model: &Model, revision: &Revision) -> ModelSize {
    // No plan: nothing was possible.
    let Some(plan) = &revision.plan else { return model.size() };
    let maps = plan.sources.iter().zip(&plan.maps);
    let texels =
        maps.map(|(&source, change)| change.applied_to(&model.textures.maps[source as usize]).num_texels());
    texels.zip(&plan.sh_degrees).fold(ModelSize::default(), |size, (texels, &degree)| ModelSize {
        splats: size.splats + 1,
        maps: size.maps + usize::from(texels > 0),
        texels: size.texels + texels,
        sh_coefficients: size.sh_coefficients + sh_coefficients(degree.into()),
    })
}

fn revise(s: &Situation<'_>, config: &DensityConfig, budget: &Budget) -> Revision {
    decide(s, config, &Components::default(), budget)
}

/// A window in which splat 5 has a much larger error than the others.
fn one_high_error() -> WindowStatistics {
    let mut errors = [0.1; N];
    errors[5] = 0.9;
    window(errors)
}

#[test]
fn bands_that_hardly_change_the_colour_are_given_back() {
    let (mut model, cameras, statistics) = (model(2), [camera()], window([0.1; N]));
    model.splats.set_sh_degrees(&[3; N]);
    model.splats.sh.fill(0.0);
    let mut sh = |splat: usize, degree: u32, value: f32| {
        model.splats.sh_of_mut(splat)[3 * sh_coefficients(degree - 1)..][..3].fill(value);
    };
    // A strong band 1; a strong band 3 above nothing; a strong band 2 and a faint band 3.
    sh(1, 1, 0.5);
    sh(2, 3, 0.5);
    sh(3, 2, 0.5);
    sh(3, 3, 1e-3);
    let histories = vec![SplatHistory::first(2); N];
    let degrees = |sh_tested: u32, below: f64| {
        let s = Situation { sh_tested, ..situation(&model, &histories, &statistics, &cameras) };
        let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, sh_below: below, ..settings() };
        let revision = revise(&s, &config, &Budget::default());
        let degrees =
            revision.plan.map_or_else(|| model.splats.sh_degrees().to_vec(), |plan| plan.sh_degrees);
        assert_eq!(revision.counts.shaded_less, degrees.iter().filter(|&&d| d < 3).count());
        degrees[..5].to_vec()
    };
    assert_eq!(degrees(3, 0.01), [0, 1, 3, 2, 0]);
    // Bands 2 and 3 are too young: they follow band 1, unless they already matter.
    assert_eq!(degrees(1, 0.01), [0, 3, 3, 3, 0]);
    assert_eq!(degrees(0, 0.01), [3; 5]);
    assert_eq!(degrees(3, 0.0), [3; 5]);
    assert_eq!(degrees(3, 10.0), [0; 5]);
    // A splat that no view saw keeps its bands; one that contributes much keeps fainter ones than others.
    let mut unseen = statistics.clone();
    unseen.seen[0] = 0;
    (unseen.contribution[1], unseen.contribution[2]) = (10.0, 1e-5);
    let s = Situation { sh_tested: 3, ..situation(&model, &histories, &unseen, &cameras) };
    let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, sh_below: 0.01, ..settings() };
    assert_eq!(revise(&s, &config, &Budget::default()).plan.unwrap().sh_degrees[..3], [3, 1, 0]);
}

#[test]
fn splats_whose_highest_band_matters_gain_another() {
    let (mut model, cameras, statistics) = (model(2), [camera()], window([0.1; N]));
    let mut held = [1; N];
    (held[3], held[4]) = (3, 0);
    model.splats.set_sh_degrees(&held);
    model.splats.sh.fill(0.0);
    // Strong, very strong, fair, strong at the highest degree, and nothing but DC.
    for (splat, value) in [0.5, 0.8, 0.1, 0.5, 0.5].into_iter().enumerate() {
        model.splats.sh_of_mut(splat)[3 * usize::from(held[splat] > 0)..].fill(value);
    }
    let mut histories = vec![SplatHistory::first(2); N];
    let degrees = |histories: &[SplatHistory], s: &dyn Fn(&mut Situation<'_>), raise: f64| {
        let mut situation = situation(&model, histories, &statistics, &cameras);
        s(&mut situation);
        let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, sh_raise: raise, ..settings() };
        let revision = revise(&situation, &config, &Budget::default());
        let degrees =
            revision.plan.map_or_else(|| model.splats.sh_degrees().to_vec(), |plan| plan.sh_degrees);
        let gained = degrees.iter().zip(held).filter(|(now, held)| *now > held).count();
        assert_eq!(revision.counts.shaded_more, gained);
        (degrees[..5].to_vec(), revision.histories)
    };
    let tested = |s: &mut Situation<'_>| (s.sh_tested, s.sh_trial_checks) = (3, 4);
    let (raised, later) = degrees(&histories, &tested, 0.2);
    assert_eq!(raised, [2, 2, 1, 3, 0]);
    assert_eq!(later[..3].iter().map(|h| h.band_checks).collect::<Vec<_>>(), [0, 0, u16::MAX]);
    assert_eq!(degrees(&histories, &tested, 0.0).0, held[..5]);
    // Not while bands are young, where bands were given back, after growth, or beyond the degree of the run.
    assert_eq!(degrees(&histories, &|s| s.sh_tested = 0, 0.2).0, held[..5]);
    (histories[0].band_checks, histories[1].bands_settled) = (1, true);
    assert_eq!(degrees(&histories, &tested, 0.2).0, held[..5]);
    histories[0].band_checks = 3;
    assert_eq!(degrees(&histories, &tested, 0.2).0, [2, 1, 1, 3, 0]);
    assert_eq!(degrees(&histories, &|s| (s.sh_tested, s.densify) = (3, false), 0.2).0, held[..5]);
    assert_eq!(degrees(&histories, &|s| (s.sh_tested, s.sh_highest) = (3, 1), 0.2).0, held[..5]);
}

#[test]
fn only_high_error_splats_are_refined_and_raise_their_ceilings() {
    let (model, cameras, statistics) = (model(2), [camera()], one_high_error());
    let histories = vec![SplatHistory::first(2); N];
    let s = situation(&model, &histories, &statistics, &cameras);
    let config = DensityConfig { coarsen_below: 0.0, ..settings() };
    let revision = revise(&s, &config, &Budget::default());
    let plan = revision.plan.unwrap();
    assert_eq!(plan.sources, (0..N as u32).collect::<Vec<_>>(), "without new splats the order is kept");
    for (i, (map, history)) in plan.maps.iter().zip(&revision.histories).enumerate() {
        match *map {
            MapChange::Regrid { grids: [Grid::Finer, Grid::Finer], rows, cols, moment_scale, .. }
                if i == 5 =>
            {
                assert!(rows <= 4 && cols <= 4 && rows.max(cols) == 4, "{rows} x {cols}");
                assert_eq!((history.ceiling, moment_scale), (4, [0.25, 0.0625]));
            }
            MapChange::Keep if i != 5 => assert_eq!(history.ceiling, 2),
            _ => panic!("{i}: {map:?}"),
        }
    }
    // Negative controls: equal errors, a low cap, texels as fine as allowed, a spent budget.
    assert!(
        revise(&Situation { statistics: &window([0.3; N]), ..s }, &config, &Budget::default()).plan.is_none()
    );
    let kept = |s: &Situation<'_>, config: &DensityConfig, budget: &Budget| {
        let revision = revise(s, config, budget);
        revision.plan.is_none_or(|plan| plan.maps.iter().all(|m| *m == MapChange::Keep))
    };
    let s = situation(&model, &histories, &statistics, &cameras);
    assert!(kept(&Situation { texture_cap: 2, ..s }, &config, &Budget::default()));
    let s = situation(&model, &histories, &statistics, &cameras);
    let coarse = DensityConfig { min_texel_px: 200.0, untextured: false, ..config.clone() };
    assert!(kept(&s, &coarse, &Budget::default()));
    let full = Budget { max_texels: Some(model.num_texels()), ..Budget::default() };
    assert!(kept(&s, &config, &full));
}

#[test]
fn maps_follow_their_support_without_moving_a_texel() {
    let (mut model, cameras, statistics) = (model(8), [camera()], window([0.3; N]));
    model.splats.log_scales[6] -= 0.7;
    model.splats.log_scales[7] -= 0.7;
    let histories = vec![SplatHistory::first(64); N];
    let s = situation(&model, &histories, &statistics, &cameras);
    let config = DensityConfig { coarsen_below: 0.0, ..settings() };
    let plan = revise(&s, &config, &Budget::default()).plan.unwrap();
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
    let s = situation(&model, &histories, &statistics, &cameras);
    let plan = revise(&s, &settings(), &Budget::default()).plan.unwrap();
    for (i, change) in plan.maps.iter().enumerate() {
        let is_coarser = matches!(change, MapChange::Regrid { grids: [Grid::Coarser, Grid::Coarser], .. });
        assert_eq!(is_coarser, i == 4, "{i}: {change:?}");
    }
    assert!(
        !s.model.textures.maps.is_empty() && {
            let late = Situation { may_coarsen: false, ..s };
            revise(&late, &settings(), &Budget::default()).plan.is_none()
        }
    );
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
        let s = situation(&model, &histories, &statistics, &cameras);
        let config = DensityConfig { grow_by_axis: factor, min_texel_px: 0.2, ..settings() };
        let plan = revise(&s, &config, &Budget::default()).plan.unwrap();
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
fn splats_are_pruned_after_consecutive_useless_checks_and_unseen_ones_are_kept() {
    let (model, cameras) = (model(2), [camera()]);
    let mut histories = vec![SplatHistory::first(2); N];
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
        let s = Situation { patience: 4, ..situation(&model, &histories, &statistics, &cameras) };
        let revision = revise(&s, &settings(), &Budget::default());
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
    let s = Situation { split_texels: 16.0, ..situation(&model, &histories, &statistics, &cameras) };
    let config = DensityConfig {
        coarsen_below: 0.0,
        spending: Spending::SplitsFirst,
        // The tight profile shifts by less than the grid allows on this map and would resample.
        split_profile: SplitProfile::Paper,
        ..settings()
    };
    // Texels are preferred and the map can still be refined.
    let patient = DensityConfig { spending: Spending::Gain, texel_gain: 1e3, ..config.clone() };
    assert_eq!(revise(&s, &patient, &Budget::default()).counts.split, 0);
    let coarse = DensityConfig { min_texel_px: 4.0, ..patient };
    let long = Situation { split_texels: 8.0, ..situation(&model, &histories, &statistics, &cameras) };
    let by_gain = revise(&long, &coarse, &Budget::default());
    assert_eq!(by_gain.counts.split, 1, "the map cannot be refined");
    assert!(by_gain.histories.iter().all(|history| history.ceiling == 64));
    let revision = revise(&s, &config, &Budget::default());
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
    let (model, cameras) = (model(2), [camera()]);
    // The first three splats are `checks` old; a prune count of one removes.
    let survivors = |model: &Model, statistics: &WindowStatistics, checks: u16| {
        let young = |i: usize| {
            if i < 3 { SplatHistory { checks, ..SplatHistory::first(2) } } else { SplatHistory::first(2) }
        };
        let histories: Vec<SplatHistory> = (0..N).map(young).collect();
        let s =
            Situation { patience: 1, densify: false, ..situation(model, &histories, statistics, &cameras) };
        let Revision { plan, histories, .. } = revise(&s, &settings(), &Budget::default());
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
fn a_step_that_can_add_nothing_changes_only_histories() {
    let (model, cameras, statistics) = (model(2), [camera()], one_high_error());
    let histories = vec![SplatHistory::first(2); N];
    let free = || situation(&model, &histories, &statistics, &cameras);
    let config = DensityConfig { coarsen_below: 0.0, untextured: false, respawn: false, ..settings() };
    let fine = DensityConfig { min_texel_px: 200.0, ..config.clone() };
    let spent = Budget { max_texels: Some(model.num_texels()), ..Budget::default() };
    // The candidate's ceiling is at the cap; its texels are as fine as allowed; the budget is spent.
    for (s, config, budget, ceiling, over_budget) in [
        (Situation { texture_cap: 2, ..free() }, &config, Budget::default(), 2, 0),
        (free(), &fine, Budget::default(), 4, 0),
        (free(), &config, spent, 2, 1),
    ] {
        let revision = revise(&s, config, &budget);
        assert!(revision.plan.is_none());
        assert_eq!(revision.counts, DensityCounts { over_budget, ..DensityCounts::default() });
        for (i, (before, after)) in histories.iter().zip(&revision.histories).enumerate() {
            let ceiling = if i == 5 { ceiling } else { 2 };
            assert_eq!(*after, SplatHistory { ceiling, checks: before.checks + 1, ..*before }, "{i}");
        }
    }
    // Negative control: none of these limits.
    let revision = revise(&free(), &config, &Budget::default());
    assert!(revision.plan.is_some() && revision.counts.refined == 1);
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
    let s = |use_statistics| Situation {
        patience: 1,
        use_statistics,
        ..situation(&model, &histories, &statistics, &cameras)
    };
    let revision = revise(&s(false), &settings(), &Budget::default());
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
    let counts = revise(&s(true), &settings(), &Budget::default()).counts;
    assert_eq!([counts.faded, counts.pruned, counts.coarsened, counts.refined], [1; 4], "{counts:?}");
}

#[test]
fn maps_cropped_by_giving_back_are_not_padded_again() {
    let (mut model, cameras, statistics) = (model(8), [camera()], window([0.3; N]));
    // One side is gone, as after a round of giving back; splat 4 has widened since, splat 5 has shrunk.
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
            let s = Situation {
                densify: false,
                use_statistics,
                may_pad,
                ..situation(&model, &histories, &statistics, &cameras)
            };
            let config = DensityConfig { coarsen_below: 0.0, ..settings() };
            revise(&s, &config, &Budget::default())
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

#[test]
fn budgets_are_never_exceeded() {
    let (model, cameras) = (model(4), [camera()]);
    let errors = std::array::from_fn(|i| 0.1 + 0.05 * i as f32);
    let (statistics, histories) = (window(errors), vec![SplatHistory::first(64); N]);
    let config =
        DensityConfig { coarsen_below: 0.0, quantile: 0.1, spending: Spending::SplitsFirst, ..settings() };
    let size = |draws_splits: bool, budget: &Budget| {
        let s = situation(&model, &histories, &statistics, &cameras);
        let s = Situation { split_texels: 8.0, draws_splits, ..s };
        let revision = revise(&s, &config, budget);
        size_after(&model, &revision)
    };
    let free = size(false, &Budget::default());
    assert!(free.splats > N + 3, "{free:?}");
    assert!(size(true, &Budget::default()).splats > N);
    for budget in [
        Budget { max_splats: Some(N + 3), ..Budget::default() },
        Budget { max_texels: Some(model.num_texels() + 40), ..Budget::default() },
        Budget { max_params: Some(model.num_params() + 200), ..Budget::default() },
        // Less than the model has: maps must be made smaller.
        Budget { max_texels: Some(model.num_texels() / 2), ..Budget::default() },
    ] {
        for draws_splits in [false, true] {
            let size = size(draws_splits, &budget);
            assert!(budget.allows(&size), "{draws_splits}, {budget:?}: {size:?}");
        }
    }
}

#[test]
fn drawn_splits_may_take_half_of_what_is_left_of_the_budget() {
    let (mut model, cameras) = (model(2), [camera()]);
    // All cost the same.
    model.splats.set_sh_degrees(&[0; N]);
    let (statistics, histories) = (window([0.5; N]), vec![SplatHistory::first(64); N]);
    // No map is refined, and no splat is long enough for the other rule.
    let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, respawn: false, ..settings() };
    let size = |draws_splits: bool, most: usize| {
        let s = situation(&model, &histories, &statistics, &cameras);
        let budget = Budget { max_params: Some(most), ..Budget::default() };
        size_after(&model, &revise(&Situation { draws_splits, ..s }, &config, &budget))
    };
    let [before, after] = [false, true].map(|draws_splits| size(draws_splits, 1_000_000));
    // 8 % of the splats.
    assert_eq!([before, after].map(|size| size.splats), [N, N + 1]);
    let cost = after.params() - before.params();
    assert_eq!(size(true, before.params() + 2 * cost), after);
    assert_eq!(size(true, before.params() + 2 * cost - 1), before);
}

#[test]
fn a_budget_is_spent_where_error_per_parameter_is_largest() {
    // Splat 5 has the larger error, but refining its map adds more texels than refining that of splat 7.
    let (mut mixed, fine, cameras) = (model(2), model(8), [camera()]);
    let extents = mixed.textures.maps.iter().zip(&fine.textures.maps).enumerate();
    let extents = extents.map(|(i, (coarse, fine))| if i == 5 { fine } else { coarse });
    let extents = extents.copied().collect::<Vec<_>>();
    mixed.textures = TexturePool::neutral(extents).unwrap();
    let mut errors = [0.1; N];
    (errors[5], errors[7]) = (0.9, 0.5);
    let (statistics, histories) = (window(errors), vec![SplatHistory::first(64); N]);
    let s = situation(&mixed, &histories, &statistics, &cameras);
    let refined = |spending, more: Option<usize>| {
        let config = DensityConfig { coarsen_below: 0.0, spending, untextured: false, ..settings() };
        let max_texels = more.map(|more| mixed.num_texels() + more);
        let plan = revise(&s, &config, &Budget { max_texels, ..Budget::default() }).plan.unwrap();
        let added = |i: usize| match plan.maps[i] {
            MapChange::Regrid { grids: [Grid::Finer, Grid::Finer], rows, cols, .. } => {
                Some((i, usize::from(rows) * usize::from(cols) - mixed.textures.maps[i].num_texels()))
            }
            _ => None,
        };
        (0..N).filter_map(added).collect::<Vec<_>>()
    };
    let both = refined(Spending::Gain, None);
    let &[(5, large), (7, small)] = &both[..] else { panic!("{both:?}") };
    assert!(small < large);
    // The budget allows one of the two.
    assert_eq!(refined(Spending::Gain, Some(large)), [(7, small)]);
    // Negative control: by error alone the large map takes the whole budget.
    assert_eq!(refined(Spending::SplitsFirst, Some(large)), [(5, large)]);
}

#[test]
fn pruned_splats_are_respawned_where_the_error_is() {
    let (mut model, cameras) = (model(2), [camera()]);
    model.splats.opacity_logits[..3].fill(-6.0);
    let errors = std::array::from_fn(|i| 0.1 + 0.05 * i as f32);
    // All maps are at their ceilings, so that only splits are possible.
    let (statistics, histories) = (window(errors), vec![SplatHistory::first(2); N]);
    let revised = |initial_splats: usize, respawn: bool, budget: &Budget| {
        let s = Situation {
            initial_splats,
            texture_cap: 2,
            ..situation(&model, &histories, &statistics, &cameras)
        };
        let config = DensityConfig { quantile: 0.1, respawn, ..settings() };
        let Revision { plan, counts, .. } = revise(&s, &config, budget);
        let plan = plan.unwrap();
        let mut split: Vec<u32> = plan.edits.iter().map(|e| plan.sources[e.splat as usize]).collect();
        split.sort_unstable();
        split.dedup();
        for edit in &plan.edits {
            let parent = plan.sources[edit.splat as usize] as usize;
            let old = &model.splats.log_scales[2 * parent..2 * parent + 2];
            let narrower = [0, 1].map(|a| (old[a] - edit.log_scales[a]).exp());
            let [_, factor, _] = config.split_profile.factors();
            let halved = narrower.map(|n| (f64::from(n) * factor - 1.0).abs() < 1e-5);
            assert!(halved[0] != halved[1], "{narrower:?} times narrower than the parent");
        }
        (plan.sources.len(), counts.faded, counts.respawned, counts.split, split)
    };
    let none = Budget::default();
    assert_eq!(
        revised(N, true, &none),
        (N, 3, 3, 0, vec![9, 10, 11]),
        "the three of largest error are split"
    );
    assert_eq!(revised(N - 2, true, &none), (N - 2, 3, 1, 0, vec![11]), "no more than initially");
    let tight = Budget { max_splats: Some(N - 1), ..none };
    assert_eq!(revised(N, true, &tight).0, N - 1, "a budget comes first");
    // Negative control: the published method.
    assert_eq!(revised(N, false, &none), (N - 3, 3, 0, 0, vec![]));
}

#[test]
fn a_refinement_in_vain_is_taken_back_along_its_axes() {
    let (model, cameras, statistics) = (model(8), [camera()], window([0.3; N]));
    let config = DensityConfig { coarsen_below: 0.0, need_db: 0.05, ..settings() };
    let change_of = |trial: Trial, error: f32| {
        let mut histories = vec![SplatHistory { error: 0.3, ..SplatHistory::first(64) }; N];
        histories[4] = SplatHistory { trial, error, ..histories[4] };
        let revision =
            revise(&situation(&model, &histories, &statistics, &cameras), &config, &Budget::default());
        let taken_back = revision.counts.taken_back;
        (revision.plan.map(|plan| plan.maps[4]), taken_back, revision.histories[4].rest)
    };
    for (trial, axes) in [
        (Trial::RefinedU, [Grid::Coarser, Grid::Same]),
        (Trial::RefinedV, [Grid::Same, Grid::Coarser]),
        (Trial::RefinedBoth, [Grid::Coarser; 2]),
    ] {
        let (change, taken_back, rest) = change_of(trial, 0.3);
        assert!(
            matches!(change, Some(MapChange::Regrid { grids, .. }) if grids == axes),
            "{trial:?}: {change:?}"
        );
        assert_eq!((taken_back, rest), (1, config.rest_checks));
        // Negative control: the error has fallen.
        assert_eq!(change_of(trial, 0.6), (None, 0, 0));
    }
    // A split in vain is not undone.
    assert_eq!(change_of(Trial::Split, 0.3), (None, 0, config.rest_checks));
}

#[test]
fn growth_ends_when_two_checks_find_that_more_parameters_do_not_pay() {
    let (model, cameras, statistics) = (model(2), [camera()], one_high_error());
    let histories = vec![SplatHistory::first(2); N];
    let config = DensityConfig { coarsen_below: 0.0, need_db: 0.05, ..settings() };
    let step = |growth: Growth, render_scale: f64| {
        let s = situation(&model, &histories, &statistics, &cameras);
        revise(&Situation { growth, render_scale, step: 70, ..s }, &config, &Budget::default())
    };
    // Refining a map hardly removes any error.
    let useless = Growth { tried: [1.0; 2], removed: [0.0, 1e-4], ..Growth::default() };
    let first = step(useless, 1.0);
    assert!(first.growth.promised_db < 0.05 && !first.growth.has_ended());
    let trials: Vec<Trial> = first.histories.iter().map(|history| history.trial).collect();
    assert!(trials[5] == Trial::Withheld || trials[5].refined_axes().is_some(), "{trials:?}");
    assert!(first.growth.before.iter().sum::<f64>() > 0.0);
    let second = step(first.growth, 1.0);
    assert_eq!((second.growth.has_ended(), second.growth.ended_step), (true, 70));
    assert_eq!(step(second.growth, 1.0).counts.refined, 0);
    // Negative controls: it removes much; images have not yet full size; nothing was measured.
    let useful = step(Growth { removed: [0.9; 2], idle_checks: 1, ..useless }, 1.0);
    assert!(useful.growth.promised_db > 0.05 && useful.growth.idle_checks == 0);
    for growth in [step(Growth { idle_checks: 1, ..useless }, 2.0), step(Growth::default(), 1.0)] {
        assert!(!growth.growth.has_ended());
    }
}
