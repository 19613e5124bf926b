//! Growth: finer maps, ceilings and what limits them.

use super::*;

#[test]
fn only_high_error_splats_are_refined_and_raise_their_ceilings() {
    let (model, cameras, statistics) = (model(2), [camera()], one_high_error());
    let histories = vec![SplatHistory::first(2); N];
    let config = DensityConfig { coarsen_below: 0.0, ..settings() };
    let s = situation(&model, &histories, &statistics, &cameras, &config);
    let revision = litetex::revise(&s);
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
    assert!(litetex::revise(&Situation { statistics: &window([0.3; N]), ..s }).plan.is_none());
    let kept = |s: &Situation<'_>| {
        let plan = litetex::revise(s).plan;
        plan.is_none_or(|plan| plan.maps.iter().all(|m| *m == MapChange::Keep))
    };
    assert!(kept(&Situation { texture_cap: 2, ..s }));
    assert!(kept(&Situation { budget: Budget { max_texels: Some(model.num_texels()), ..s.budget }, ..s }));
    // Too fine also to be kept by this rule, but not by the published one, which drops no map.
    let coarse = DensityConfig { min_texel_px: 200.0, ..config.clone() };
    let s = Situation { settings: &coarse, ..s };
    assert!(revise_as_paper(&s).plan.is_none() && litetex::revise(&s).counts.coarsened > 0);
}

#[test]
fn a_step_that_can_add_nothing_changes_only_histories() {
    let (model, cameras, statistics) = (model(2), [camera()], one_high_error());
    let histories = vec![SplatHistory::first(2); N];
    let config = DensityConfig { coarsen_below: 0.0, ..settings() };
    let fine = DensityConfig { min_texel_px: 200.0, ..config.clone() };
    let spent = Budget { max_texels: Some(model.num_texels()), ..Budget::default() };
    let free = situation(&model, &histories, &statistics, &cameras, &config);
    // The candidate's ceiling is at the cap; its texels are as fine as allowed; the budget is spent.
    for (s, ceiling, over_budget) in [
        (Situation { texture_cap: 2, ..free }, 2, 0),
        (Situation { settings: &fine, ..free }, 4, 0),
        (Situation { budget: spent, ..free }, 2, 1),
    ] {
        let revision = revise_as_paper(&s);
        assert!(revision.plan.is_none());
        assert_eq!(revision.counts, DensityCounts { over_budget, ..DensityCounts::default() });
        for (i, (before, after)) in histories.iter().zip(&revision.histories).enumerate() {
            let ceiling = if i == 5 { ceiling } else { 2 };
            assert_eq!(*after, SplatHistory { ceiling, checks: before.checks + 1, ..*before }, "{i}");
        }
    }
    // Negative control: none of these limits.
    for revision in [revise_as_paper(&free), litetex::revise(&free)] {
        assert!(revision.plan.is_some() && revision.counts.refined == 1);
    }
}
