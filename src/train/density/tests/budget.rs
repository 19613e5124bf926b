//! Budgets: bounds, splits of any length, what is bought.

use super::*;

#[test]
fn budgets_are_never_exceeded() {
    let (model, cameras) = (model(4), [camera()]);
    let errors = std::array::from_fn(|i| 0.1 + 0.05 * i as f32);
    let (statistics, histories) = (window(errors), vec![SplatHistory::first(64); N]);
    let config = DensityConfig { coarsen_below: 0.0, quantile: 0.1, ..settings() };
    let rules = [revise_as_paper, litetex::revise, litetex::revise];
    let lengths = [Some(8.0), Some(8.0), None];
    let sizes = |budget: Budget| {
        let s = situation(&model, &histories, &statistics, &cameras, &config);
        let s = Situation { budget, ..s };
        [0, 1, 2].map(|i| {
            let timing = Timing { split_texels: lengths[i], ..TIMING };
            size_after(&model, &rules[i](&Situation { timing, ..s }))
        })
    };
    assert!(sizes(Budget::default()).iter().all(|size| size.splats > N + 3));
    for budget in [
        Budget { max_splats: Some(N + 3), ..Budget::default() },
        Budget { max_texels: Some(model.num_texels() + 40), ..Budget::default() },
        Budget { max_params: Some(model.num_params() + 200), ..Budget::default() },
        // Less than the model has: maps must be made smaller.
        Budget { max_texels: Some(model.num_texels() / 2), ..Budget::default() },
    ] {
        for size in sizes(budget) {
            assert!(budget.allows(&size), "{budget:?}: {size:?}");
        }
    }
}

#[test]
fn splits_are_limited_in_number_and_by_the_budget() {
    let (mut model, cameras) = (model(2), [camera()]);
    model.splats.set_sh_degrees(&[0; N]);
    let (statistics, histories) = (window([0.5; N]), vec![SplatHistory::first(64); N]);
    // No map is refined.
    let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, ..settings() };
    let revise = |split_texels: Option<f64>, most: usize| {
        let timing = Timing { split_texels, max_splits: 2, ..TIMING };
        let budget = Budget { max_params: Some(most), ..Budget::default() };
        let s = situation(&model, &histories, &statistics, &cameras, &config);
        litetex::revise(&Situation { timing, budget, ..s })
    };
    let before = size_after(&model, &revise(Some(1000.0), 1_000_000));
    assert_eq!(before.splats, N, "none is long");
    let all = revise(None, 1_000_000);
    assert_eq!(all.counts.split, 2);
    // All splats cost the same.
    let cost = (size_after(&model, &all).params() - before.params()) / 2;
    let splats = |more| size_after(&model, &revise(None, before.params() + more)).splats;
    assert_eq!([cost - 1, cost, 2 * cost].map(splats), [N, N + 1, N + 2]);

    // The same by bytes, in a run whose file has a wanted size and which prunes nothing.
    let charge = Charge::BYTES;
    let [before, one, two] =
        [&before, &size_after(&model, &revise(None, before.params() + cost)), &size_after(&model, &all)]
            .map(|size| charge.of_size(size));
    let splats = |most_charge| {
        let timing = Timing { split_texels: None, max_splits: 2, ..TIMING };
        let s = situation(&model, &histories, &statistics, &cameras, &config);
        size_after(&model, &litetex::revise(&Situation { timing, charge, most_charge, ..s })).splats
    };
    assert_eq!([before, one, two].map(splats), [N, N + 1, N + 2]);
    assert_eq!(splats(f64::INFINITY), N + 2, "negative control: no bound");
}

#[test]
fn what_removes_most_error_per_parameter_comes_first() {
    // Splat 5 has the larger error, but refining its map adds more texels than refining that of splat 7.
    let (mut mixed, fine, cameras) = (model(2), model(8), [camera()]);
    let extents = mixed.textures.maps.iter().zip(&fine.textures.maps).enumerate();
    let extents = extents.map(|(i, (coarse, fine))| if i == 5 { fine } else { coarse });
    let extents = extents.copied().collect::<Vec<_>>();
    mixed.textures = TexturePool::neutral(extents).unwrap();
    let mut errors = [0.1; N];
    (errors[5], errors[7]) = (0.9, 0.5);
    let (statistics, histories) = (window(errors), vec![SplatHistory::first(64); N]);
    let config = DensityConfig { coarsen_below: 0.0, ..settings() };
    // Idle maps are dropped by one rule, unless texels are young.
    let timing = Timing { texels_trained: false, ..TIMING };
    let refined = |rule: fn(&Situation<'_>) -> Revision, more: Option<usize>, seed: u64| {
        let max_texels = more.map(|more| mixed.num_texels() + more);
        let budget = Budget { max_texels, ..Budget::default() };
        let s = situation(&mixed, &histories, &statistics, &cameras, &config);
        let plan = rule(&Situation { budget, timing, seed, ..s }).plan.unwrap();
        let added = |i: usize| match plan.maps[i] {
            MapChange::Regrid { grids: [Grid::Finer, Grid::Finer], rows, cols, .. } => {
                Some((i, usize::from(rows) * usize::from(cols) - mixed.textures.maps[i].num_texels()))
            }
            _ => None,
        };
        (0..N).filter_map(added).collect::<Vec<_>>()
    };
    let both = refined(litetex::revise, None, 0);
    let &[(5, large), (7, small)] = &both[..] else { panic!("{both:?}") };
    assert!(small < large);
    // The budget allows one of the two.
    let drawn = |seed| refined(litetex::revise, Some(large), seed)[0].0;
    let sevens = (0..100).filter(|&seed| drawn(seed) == 7).count();
    let share = 0.5 / small as f64 / (0.5 / small as f64 + 0.9 / large as f64);
    // Standard deviation 0.05 at most.
    assert!(share > 0.6 && (sevens as f64 / 100.0 - share).abs() < 0.15, "{sevens} of 100, {share}");
    // Negative control: by error alone the large map takes the whole budget.
    assert_eq!(refined(revise_as_paper, Some(large), 0), [(5, large)]);
}

#[test]
fn splits_finer_maps_and_bands_compete() {
    let (mut model, cameras) = (model(2), [camera()]);
    model.splats.set_sh_degrees(&std::array::from_fn::<u8, N, _>(|i| u8::from(i == 0)));
    // The first band of splat 0 changes its colour by 0.3.
    let sh = model.splats.sh_offsets()[0] as usize;
    model.splats.sh[sh + 3] = 0.3 * (12.0 * std::f32::consts::PI).sqrt();
    let mut histories = vec![SplatHistory::first(64); N];
    histories.iter_mut().for_each(|history| history.band_checks = 3);
    let config =
        DensityConfig { coarsen_below: 0.0, quantile: 0.0, sh_below: 1e-6, sh_raise: 0.2, ..settings() };
    let timing = Timing { sh_tested: 3, sh_trial_checks: 4, split_texels: None, ..TIMING };
    // How often of 200 times, with room for one of each.
    let counts = |error_of_0: f32, timing: Timing, more: usize| {
        let budget = Budget { max_params: Some(model.num_params() + more), ..Budget::default() };
        let mut errors = std::array::from_fn(|i| 0.5 + 0.01 * i as f32);
        errors[0] = error_of_0;
        let statistics = window(errors);
        let s = Situation { timing, budget, ..situation(&model, &histories, &statistics, &cameras, &config) };
        let mut sums = [0; 3];
        for seed in 0..200 {
            let counts = litetex::revise(&Situation { seed, ..s }).counts;
            let counts = [counts.split, counts.refined, counts.bands_gained];
            sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        sums
    };
    // A finer map costs 36 parameters, a split 27, a band 15.
    assert_eq!(counts(0.5, timing, 15), [0, 0, 200], "nothing else fits");
    let [splits, maps, bands] = counts(5.0, timing, 36);
    assert!(splits > 3 * maps && maps > 0 && bands > 20, "{splits} {maps} {bands}");
    // A band of a splat of little error; no splits.
    assert!(counts(0.05, timing, 36)[2] < bands / 2);
    let [none, more, _] = counts(0.5, Timing { max_splits: 0, ..timing }, 36);
    assert!(none == 0 && more > 2 * maps, "{none} {more}");
}
