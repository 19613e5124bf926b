//! A run that outgrows its device stops growing, reduces its images where a step does not fit, says so once, and goes on: on the
//! CPU backend with artificial limits.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::room::{Call, Outcome, PLENTY, Room, Small, check, growing, run_with, scene, unbounded};
use common::training::{damaged, photos};
use litetex_gs::Error;
use litetex_gs::backend::{Backend, LearningRates, LossWeights, StepRequest};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::AdamState;
use litetex_gs::train::density::Budget;
use litetex_gs::train::{
    Control, DeviceBound, GROWTH_ENDED, SMALLER_IMAGES, Schedule, TrainConfig, TrainEvent, TrainState, train,
};

#[test]
fn growth_that_does_not_fit_is_refused_and_the_run_goes_on() {
    let plenty = unbounded();
    let most = 200;
    assert!(plenty.splats > most, "{} splats: nothing was tested", plenty.splats);
    let out = check(Room { splats: most, ..PLENTY }, &[GROWTH_ENDED]);
    assert!((150..=most).contains(&out.splats), "{}", out.splats);
    let params = out.state.device.budget.max_params.unwrap();
    let parts = ["step ", "small: plan", "--budget-params "];
    assert!(parts.iter().all(|part| out.warnings[0].1.contains(part)), "{:?}", out.warnings);
    assert!(out.state.model.num_params() <= params);
}

#[test]
fn growth_ends_before_a_step_needs_more_pairs_than_fit() {
    let plenty = unbounded();
    let first = first_pairs();
    // Half of what growth adds.
    let pairs = u64::midpoint(first, plenty.pairs);
    let out = check(Room { pairs, ..PLENTY }, &[GROWTH_ENDED]);
    println!("{first} pairs at first, {} of {pairs} at most, {} without a limit", out.pairs, plenty.pairs);
    assert!(out.pairs <= pairs && out.splats < plenty.splats && out.splats > 150);
    assert_eq!(out.state.device.least_scale, 1.0);
    assert!(out.warnings[0].1.contains("tile-splat pairs"), "{:?}", out.warnings);
}

/// Most pairs of a view of the first model.
fn first_pairs() -> u64 {
    let scene = scene();
    let (model, views) = (damaged(&scene), photos(&scene));
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    backend.upload(&model, &AdamState::zeros(&model)).unwrap();
    let request = |view: usize| StepRequest {
        step: 1,
        camera: views.0[view].0,
        photo: None,
        target: &views.0[view].1,
        background: [0.0; 3],
        sh_degree: 0,
        loss: LossWeights::default(),
        rates: LearningRates::default(),
        accumulate_statistics: false,
        exposure: None,
    };
    (1..6).map(|view| backend.step(&request(view)).unwrap().counters.tile_pairs).max().unwrap()
}

#[test]
fn images_stay_smaller_where_a_step_does_not_fit() {
    let first = first_pairs();
    // Not even the first model fits.
    let room = Room { pairs: first * 3 / 4, ..PLENTY };
    let out = check(room, &[SMALLER_IMAGES]);
    // Nor does an evaluation.
    check(Room { images: false, ..room }, &[SMALLER_IMAGES, "no-test-figures"]);
    let scale = out.state.device.least_scale;
    println!("{first} pairs at first, {} at most, render scale {scale}", out.pairs);
    assert!(out.pairs <= room.pairs && scale > 1.0 && scale < 3.0, "{scale}");
    assert_eq!(out.splats, 150);
}

#[test]
fn a_model_that_cannot_be_read_is_left_as_it_is() {
    let plenty = unbounded();
    for (call, number) in [(Call::ReadFlushed, 3), (Call::ReadStatistics, 3)] {
        let out = check(Room { refused: Some((call, [number; 2])), ..PLENTY }, &[GROWTH_ENDED]);
        assert!(out.splats < plenty.splats);
        let message = &out.warnings[0].1;
        assert!(message.contains("the model stays at ") && !message.contains("use less"), "{message}");
    }
    // No room for images of 32 pixels either: the error remains.
    let scene = scene();
    let mut backend = Small::new(Room { pairs: 1, ..PLENTY }, 1);
    let start = TrainState::fresh(damaged(&scene));
    let mut saved = Vec::new();
    let error = train(&growing(), &mut backend, &photos(&scene), start, &mut |event| {
        if let TrainEvent::Checkpoint { state, .. } = event {
            saved.push(state.device);
        }
        Ok(Control::Continue)
    });
    assert!(matches!(error, Err(Error::DeviceFull(_))));
    assert_eq!(saved, [DeviceBound::default()], "a device with more room goes on in full size");
    assert!((25..=32).contains(&backend.side_px), "{} px", backend.side_px);
}

#[test]
fn the_budget_of_the_warning_keeps_within_the_device() {
    let scene = scene();
    let (views, start) = (photos(&scene), TrainState::fresh(damaged(&scene)));
    let mut config = growing();
    config.density.prune_db = TrainConfig::default().density.prune_db;
    let room = Room { splats: 200, ..PLENTY };
    let of = |config: &TrainConfig| run_with(config, room, 3, &views, start.clone());
    let out = of(&config);
    assert_eq!(out.codes(), [GROWTH_ENDED]);
    let proposed = proposed_by(&out);
    config.budget = budget(proposed);
    let most = Schedule::new(&config, 5).budget(&config, 0).max_params.unwrap();
    let before = out.warnings[0].1.split_once(" parameters").unwrap().0;
    let ended: usize = before.rsplit(' ').next().unwrap().replace(',', "").parse().unwrap();
    println!("{proposed} proposed, {most} parameters in growth, which ended with {ended}");
    assert!(most <= ended && most > ended - 5, "growth may exceed the budget");
    // It is less than a budget of the user's own that did not keep within the device.
    let own = start.model.num_params();
    config.budget = budget(own);
    let out = of(&config);
    assert_eq!(out.codes(), [GROWTH_ENDED]);
    assert!(proposed_by(&out) < own, "{own}: {:?}", out.warnings);
}

fn proposed_by(out: &Outcome) -> usize {
    let after = out.warnings[0].1.split_once("--budget-params ").unwrap().1;
    after.split(' ').next().unwrap().parse().unwrap()
}

fn budget(max_params: usize) -> Budget {
    Budget { max_params: Some(max_params), ..Budget::default() }
}
