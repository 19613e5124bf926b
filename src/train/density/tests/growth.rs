//! Growth: candidates, what is taken back, and its end.

use super::*;

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
fn a_refinement_in_vain_is_taken_back_along_its_axes() {
    let (model, cameras, statistics) = (model(8), [camera()], window([0.3; N]));
    let config = DensityConfig { coarsen_below: 0.0, need_db: 0.05, ..settings() };
    let change_of = |trial: Trial, error: f32| {
        let mut histories = vec![SplatHistory { error: 0.3, ..SplatHistory::first(64) }; N];
        let kind = trial.grown().unwrap();
        (5..N).chain(0..3).for_each(|i| histories[i].trial = Trial::Withheld(kind));
        histories[4] = SplatHistory { trial, error, ..histories[4] };
        let s = situation(&model, &histories, &statistics, &cameras);
        let resized = revise(&Situation { images_resized: true, ..s }, &config, &Budget::default());
        // Errors in images of different sizes tell nothing.
        assert_eq!(
            (resized.counts.taken_back, resized.growth, resized.histories[4].rest),
            (0, Growth::default(), 0)
        );
        let s = situation(&model, &histories, &statistics, &cameras);
        let revision = revise(&s, &config, &Budget::default());
        assert!(revision.growth != Growth::default());
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

/// As if this had been measured: the shares of their losses that splats lose by a split, a refined map or another band.
pub fn measured(shares: [f64; KINDS]) -> Growth {
    let left = |after| Outcome { splats: 100.0, before: 1.0, after, squares: [0.0; 3] };
    Growth { grown: shares.map(|share| left(1.0 - share)), withheld: [left(1.0); KINDS], ..Growth::default() }
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
    let useless = measured([0.0, 1e-4, 0.0]);
    let first = step(useless, 1.0);
    assert!(first.growth.promised_db.unwrap()[0] < 0.05 && !first.growth.has_ended());
    let trials: Vec<Trial> = first.histories.iter().map(|history| history.trial).collect();
    assert!(trials[5] == Trial::Withheld(Kind::Refined) || trials[5].refined_axes().is_some(), "{trials:?}");
    let second = step(first.growth, 1.0);
    assert_eq!((second.growth.has_ended(), second.growth.ended_step), (true, 70));
    assert_eq!(step(second.growth, 1.0).counts.refined, 0);
    // Too few splats were withheld: nothing is known, and a check does not count.
    let few = Outcome { splats: 9.0, before: 1.0, after: 1.0, squares: [0.0; 3] };
    let barely = Growth { withheld: [few; KINDS], idle_checks: 1, ..useless };
    let unknown = step(barely, 1.0);
    assert!(!unknown.growth.has_ended() && unknown.growth.idle_checks == 1);
    // The share is as small, but may be much larger: a few splats carry the loss.
    let varied = |o: Outcome| Outcome { squares: [0.25, 0.1 * o.after, 0.25 * o.after * o.after], ..o };
    let vague = Growth {
        grown: useless.grown.map(varied),
        withheld: useless.withheld.map(varied),
        idle_checks: 1,
        ..useless
    };
    let unsure = step(vague, 1.0);
    assert!(
        unsure.growth.promised_db.unwrap()[0] < 0.05
            && unsure.growth.idle_checks == 0
            && !unsure.growth.has_ended()
    );
    // Negative controls: it removes much; images have not yet full size; nothing was measured.
    let useful = step(Growth { idle_checks: 1, ..measured([0.9; KINDS]) }, 1.0);
    assert!(useful.growth.promised_db.unwrap()[0] > 0.05 && useful.growth.idle_checks == 0);
    for growth in [step(Growth { idle_checks: 1, ..useless }, 2.0), step(Growth::default(), 1.0)] {
        assert!(!growth.growth.has_ended());
    }
}
