//! Budgets: bounds, drawn splits, what is bought.

use super::*;

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
