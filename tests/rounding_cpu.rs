//! Models that are trained as a file of a wanted size will hold them.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::sized::{self, MAX_BYTES, asset, differing, rounder};
use common::training::{MemoryViews, config, damaged, photos, scene};
use litetex_exporters::ltgs::{LtgsOptions, encode};
use litetex_exporters::{Quality, SplatAsset};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::Model;
use litetex_gs::rounding::Rounder;
use litetex_gs::train::{TrainConfig, TrainState};
use litetex_gs::verify::FileRounder;

/// Trains on the CPU, with rounding or without, and returns the final state and every checkpoint.
fn run(config: &TrainConfig, views: &MemoryViews, start: TrainState) -> (TrainState, Vec<TrainState>) {
    sized::run(&mut CpuBackend::new(Some(2)).unwrap(), config, views, start)
}

/// A run of 200 steps whose last part is rounded.
fn sized() -> TrainConfig {
    TrainConfig { max_bytes: Some(MAX_BYTES), ..config(200) }
}

#[test]
fn the_trained_model_is_what_its_file_holds() {
    let scene = scene();
    let views = photos(&scene);
    let (state, _) = run(&sized(), &views, TrainState::fresh(damaged(&scene)));
    let rounded = state.rounded.as_ref().unwrap();
    assert_eq!(rounded.step, 200);
    let rounder = rounder(&views, MAX_BYTES).unwrap();
    let again = rounder.round(&state.model, &rounded.steps, true).unwrap();
    let asset = asset(&state.model, &views);
    let differing = |other: &Model| differing(&state.model, other);
    assert_eq!(differing(&again), [0; 6], "a rounded model is rounded to itself");
    let options = LtgsOptions {
        quality: Quality::Custom,
        steps: Some(rounded.steps.steps()),
        per_splat: rounded.steps.per_splat(),
        ..LtgsOptions::default()
    };
    let bytes = encode(&asset, &options).unwrap().len() as u64;
    println!("{bytes} bytes");
    assert!((MAX_BYTES * 19 / 20..=MAX_BYTES).contains(&bytes), "{bytes}");
    // Negative control: before the last rounding, the numbers were others.
    let mut exact = state.model.clone();
    rounded.offsets.apply(&mut exact, -1.0);
    let changed = differing(&exact);
    assert!(changed.iter().all(|&count| count > 100), "{changed:?}");
}

#[test]
fn a_run_with_rounding_resumes_bit_for_bit() {
    let scene = scene();
    let views = photos(&scene);
    let config = sized();
    let (whole, saved) = run(&config, &views, TrainState::fresh(damaged(&scene)));
    let within: Vec<&TrainState> = saved.iter().filter(|s| s.rounded.is_some() && s.step < 200).collect();
    assert!(within.len() >= 2, "no checkpoint within the last phase");
    assert!(within.iter().any(|s| s.rounded.as_ref().unwrap().step < s.step), "none between two roundings");
    for start in within {
        let (resumed, _) = run(&config, &views, start.clone());
        assert!(resumed.model == whole.model && resumed.rounded == whole.rounded, "from step {}", start.step);
    }
    // Negative control: with one bit of what rounding added.
    let mut other = saved.iter().find(|s| s.rounded.is_some()).unwrap().clone();
    let offset = &mut other.rounded.as_mut().unwrap().offsets.splats.opacity_logits[0];
    *offset = f32::from_bits(offset.to_bits() ^ (1 << 22));
    assert!(run(&config, &views, other).0.rounded != whole.rounded);
}

#[test]
fn numbers_are_exact_again_if_a_run_goes_on_without_rounding() {
    let scene = scene();
    let views = photos(&scene);
    let (_, saved) = run(&sized(), &views, TrainState::fresh(damaged(&scene)));
    let start = saved
        .iter()
        .find(|s| s.rounded.as_ref().is_some_and(|r| r.step == s.step))
        .unwrap_or_else(|| saved.iter().find(|s| s.rounded.is_some()).unwrap());
    let mut exact = start.clone();
    let rounded = exact.rounded.take().unwrap();
    rounded.offsets.apply(&mut exact.model, -1.0);
    let without = TrainConfig { max_bytes: None, ..sized() };
    let (from_rounded, _) = run(&without, &views, start.clone());
    let (from_exact, _) = run(&without, &views, exact);
    assert!(from_rounded.rounded.is_none() && from_rounded.model == from_exact.model);
    // Negative control: as if rounding had added nothing.
    let (other, _) = run(&without, &views, TrainState { rounded: None, ..start.clone() });
    assert!(other.model != from_exact.model);
}

#[test]
fn sizes_that_no_file_has_are_refused_with_the_smallest() {
    let views = photos(&scene());
    let error = rounder(&views, 500).err().unwrap().to_string();
    println!("{error}");
    let least = error.split("smallest file has ").nth(1).and_then(|rest| rest.split(' ').next());
    let least: u64 = least.unwrap().parse().unwrap();
    assert!(rounder(&views, least).is_ok() && rounder(&views, least - 1).is_err());
}

#[test]
fn cameras_and_metadata_take_little_of_a_small_file() {
    let views = photos(&scene());
    let turned = |i: usize| {
        let mut camera = views.0[i % 6].0;
        let angle = 0.7 * i as f64;
        camera.camera_from_local.rotation *= glam::DMat3::from_rotation_y(0.3 * angle.sin());
        camera.camera_from_local.translation +=
            glam::DVec3::new(angle.cos(), 0.1 * angle.sin(), 0.3 * angle.cos());
        litetex_gs::bake::asset_camera(&format!("IMG_{:04}.jpg", 1234 + 7 * i), i.is_multiple_of(8), &camera)
    };
    let bytes = |count: usize| {
        let frame = SplatAsset { cameras: (0..count).map(turned).collect(), ..SplatAsset::default() };
        let error = FileRounder::new(frame, 100, &sized::statistics, &|| true).err().unwrap().to_string();
        let words: Vec<&str> = error.split(' ').collect();
        let at = words.windows(3).position(|three| three == ["of", "them", "for"]).unwrap();
        words[at - 1].parse::<u64>().unwrap()
    };
    let [none, thirty] = [0, 30].map(bytes);
    println!("{none} bytes, {thirty} with 30 cameras");
    assert!(thirty <= 1_200, "{thirty}");
    // Negative control: more than the names of 30 photos, and what is the same for all files, is stored.
    assert!(thirty > none + 300, "{none} {thirty}");
}
