//! What a run leaves out because its device has no room for it: checkpoints, rounds of pruning, statistics, roundings.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::room::{Call, Outcome, PLENTY, Room, attempt, check, growing, run_with, scene, unbounded};
use common::sized::MAX_BYTES;
use common::training::{self, config, damaged, photos};
use litetex_gs::Error;
use litetex_gs::train::{Schedule, TrainConfig, TrainState};

#[test]
fn checkpoints_that_cannot_be_read_are_left_out() {
    let plenty = unbounded();
    // Density control reads the statistics first, after step 5.
    for (call, numbers, left_out) in
        [(Call::ReadBack, [1, 3], 3), (Call::ReadStatistics, [2, 2], 1), (Call::ReadBack, [8, 8], 1)]
    {
        let out = check(
            Room { refused: Some((call, numbers)), ..PLENTY },
            &["checkpoint-not-saved"].repeat(left_out),
        );
        assert_eq!(out.saved.len() + left_out, plenty.saved.len());
        assert!(out.file() == plenty.file(), "the run is the same");
        assert!(out.warnings[0].1.contains("another --device"), "{:?}", out.warnings);
    }
}

#[test]
fn rounds_of_pruning_that_do_not_fit_are_left_out() {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    let most = start.model.num_params();
    for budget in [None, Some(most)] {
        let mut config = growing();
        config.density.prune_db = TrainConfig::default().density.prune_db;
        config.budget.max_params = budget;
        let of = |numbers| {
            let room = Room { refused: Some((Call::Save, numbers)), ..PLENTY };
            run_with(&config, room, 3, &views, start.clone())
        };
        let plenty = of([0; 2]);
        assert!(plenty.warnings.is_empty(), "{:?}", plenty.warnings);
        let rounds = plenty.state.history.pruned.len();
        let (one, all) = (of([1; 2]), of([1, usize::MAX]));
        assert_eq!(one.codes(), ["not-pruned"]);
        assert!(rounds > 1 && all.codes() == ["not-pruned"].repeat(rounds), "{rounds}: {:?}", all.warnings);
        assert!(one.state.history.pruned.len() < rounds && all.state.history.pruned.is_empty());
        let params = |out: &Outcome| out.state.model.num_params();
        println!("{budget:?}: {}, {}, {} parameters", params(&plenty), params(&one), params(&all));
        assert!(params(&one) < params(&all));
        if let Some(most) = budget {
            // The last round makes up for the one left out. Without any, maps may still become small enough.
            assert!(params(&plenty) <= most && params(&one) <= most);
        }
        assert_eq!(all.steps.len(), 60);
    }
}

#[test]
fn a_round_refused_in_its_middle_leaves_the_state_of_before() {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    let mut config = growing();
    config.density.prune_db = TrainConfig::default().density.prune_db;
    let room = |call, last| Room { refused: Some((call, [1, last])), ..PLENTY };
    let of = |call| run_with(&config, room(call, 1), 3, &views, start.clone());
    let not_begun = of(Call::Save);
    for call in [Call::Probe, Call::Render, Call::Restore] {
        let out = of(call);
        assert_eq!(out.codes(), ["not-pruned"]);
        assert!(out.file() == not_begun.file(), "as if the round had not begun");
    }
    // Negative control.
    let plenty = run_with(&config, PLENTY, 3, &views, start.clone());
    assert!(plenty.file() != not_begun.file());

    // A state that cannot be restored is not saved either: the checkpoint before it stays.
    let (out, ended) = attempt(&config, room(Call::Restore, usize::MAX), 3, &views, start.clone());
    assert!(matches!(ended, Err(Error::Device(_))), "{ended:?}");
    let saved = out.saved.last().unwrap();
    assert_eq!(saved.histories.len(), saved.model.num_splats());
    assert!(run_with(&config, PLENTY, 3, &views, saved.clone()).file() == plenty.file());
}

#[test]
fn a_statistics_window_that_does_not_fit_begins_anew() {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    // Until growth starts, density-control steps leave the window as it is.
    let mut config = growing();
    config.density.start = 15_000;
    let of = |refused| run_with(&config, Room { refused, ..PLENTY }, 3, &views, start.clone());
    let out = of(Some((Call::SetStatistics, [3, 3])));
    assert!(out.warnings.is_empty() && out.steps.len() == 60);
    assert!(out.file() != of(None).file(), "negative control: a window was refused");
}

#[test]
fn roundings_that_do_not_fit_are_left_out_but_for_the_last() {
    let scene = training::scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    let mut config =
        TrainConfig { max_bytes: Some(MAX_BYTES), eval_every: 0, save_every: 0, save_secs: 0, ..config(200) };
    // Trials of merges read the state, too.
    config.density.prune_db = 0.0;
    let roundings = Schedule::new(&config, 5).rounding.unwrap().roundings_after(0) as usize;
    assert!(roundings > 2);
    // Each reads the state once; the end of the run does, too.
    let room = |numbers| Room { refused: Some((Call::ReadBack, numbers)), ..PLENTY };
    let of = |numbers| run_with(&config, room(numbers), 3, &views, start.clone());
    let plenty = of([0; 2]);
    assert!(plenty.warnings.is_empty());
    for (numbers, left_out) in [([1, 1], 1), ([2, 2], 1), ([1, roundings - 1], roundings - 1)] {
        let out = of(numbers);
        assert_eq!(out.codes(), ["not-rounded"].repeat(left_out));
        let last = out.state.rounded.as_ref().unwrap();
        assert_eq!((last.step, last.is_last, out.steps.len()), (200, true, 200));
        assert!(out.file() != plenty.file(), "negative control: it was trained with other numbers");
    }
    // The last one is the run's result: a device with more room goes on from the checkpoint.
    let (out, ended) = attempt(&config, room([roundings; 2]), 3, &views, start.clone());
    assert!(matches!(ended, Err(Error::DeviceFull(_))), "{ended:?}");
    let saved = out.saved.last().unwrap();
    assert!(saved.step == 200 && !saved.rounded.as_ref().unwrap().is_last);
    assert!(run_with(&config, PLENTY, 3, &views, saved.clone()).file() == plenty.file());
}
