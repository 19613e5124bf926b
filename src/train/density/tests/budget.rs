//! Budgets: bounds, drawn splits, what is bought.

use super::*;

#[test]
fn budgets_are_never_exceeded() {
    let (model, cameras) = (model(4), [camera()]);
    let errors = std::array::from_fn(|i| 0.1 + 0.05 * i as f32);
    let (statistics, histories) = (window(errors), vec![SplatHistory::first(64); N]);
    let config =
        DensityConfig { coarsen_below: 0.0, quantile: 0.1, spending: Spending::SplitsFirst, ..settings() };
    let size = |draws_growth: bool, budget: &Budget| {
        let s = situation(&model, &histories, &statistics, &cameras);
        let s = Situation { split_texels: 8.0, draws_growth, ..s };
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
        for draws_growth in [false, true] {
            let size = size(draws_growth, &budget);
            assert!(budget.allows(&size), "{draws_growth}, {budget:?}: {size:?}");
        }
    }
}

#[test]
fn drawn_growth_splits_at_its_rate_and_withholds_a_tenth() {
    let (mut model, cameras) = (model(2), [camera()]);
    model.splats.set_sh_degrees(&[0; N]);
    let (statistics, histories) = (window([0.5; N]), vec![SplatHistory::first(64); N]);
    // No map is refined, and no splat is long enough for the other rule.
    let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, respawn: false, ..settings() };
    let revision = |draws_growth: bool, seed: u64, most: usize| {
        let s = situation(&model, &histories, &statistics, &cameras);
        let budget = Budget { max_params: Some(most), ..Budget::default() };
        revise(&Situation { draws_growth, seed, ..s }, &config, &budget)
    };
    let before = size_after(&model, &revision(false, 0, 1_000_000));
    assert_eq!(before.splats, N);
    let withheld = |seed: u64| {
        let revision = revision(true, seed, 1_000_000);
        // 16 % of 12 splats.
        assert_eq!(revision.counts.split, 2);
        revision.histories.iter().filter(|history| history.trial == Trial::Withheld(Kind::Split)).count()
    };
    // A tenth of those drawn: 44 of 444, standard deviation 7.
    let total: usize = (0..200).map(withheld).sum();
    assert!((20..70).contains(&total), "{total}");
    // All splats cost the same.
    assert_eq!(withheld(1), 0);
    let cost = (size_after(&model, &revision(true, 1, 1_000_000)).params() - before.params()) / 2;
    let splats = |more| size_after(&model, &revision(true, 1, before.params() + more)).splats;
    assert_eq!([cost - 1, cost, 2 * cost].map(splats), [N, N + 1, N + 2]);
}

#[test]
fn all_growth_competes_in_one_currency() {
    let (mut model, cameras) = (model(2), [camera()]);
    model.splats.set_sh_degrees(&[1; N]);
    // The first band of splat 0 changes its colour by 0.3.
    let sh = model.splats.sh_offsets()[0] as usize;
    model.splats.sh[sh + 3] = 0.3 * (12.0 * std::f32::consts::PI).sqrt();
    let errors = std::array::from_fn(|i| 0.5 + 0.01 * i as f32);
    let (statistics, mut histories) = (window(errors), vec![SplatHistory::first(64); N]);
    histories.iter_mut().for_each(|history| history.band_checks = 3);
    let config =
        DensityConfig { coarsen_below: 0.0, quantile: 0.0, sh_below: 1e-6, sh_raise: 0.2, ..settings() };
    // A split and a refined map cost 36 parameters each: there is room for one of them.
    let budget = Budget { max_params: Some(model.num_params() + 36), ..Budget::default() };
    let tried = |growth: Growth| {
        let mut tried = [0; 3];
        for seed in 0..100 {
            let s = situation(&model, &histories, &statistics, &cameras);
            let s = Situation { draws_growth: true, sh_tested: 3, sh_trial_checks: 4, seed, growth, ..s };
            let revision = revise(&s, &config, &budget);
            assert!(budget.allows(&size_after(&model, &revision)));
            for history in revision.histories {
                if let Some(kind) = history.trial.grown() {
                    tried[kind as usize] += 1;
                }
            }
        }
        // Both halves were counted.
        tried[0] /= 2;
        tried
    };
    // What kinds were worth decides which of them the budget buys.
    let [splits, others] = [[0.8, 0.1, 0.1], [0.1, 0.8, 0.8]].map(|shares| tried(growth::measured(shares)));
    assert!(splits[0] > 2 * splits[1] && others[1] > 2 * others[0], "{splits:?} {others:?}");
    assert!(others[2] > splits[2], "{splits:?} {others:?}");
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
