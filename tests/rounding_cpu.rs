//! Models that are trained as a file of a wanted size will hold them.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::training::{MemoryViews, config, damaged, photos, scene};
use litetex_exporters::ltgs::{LtgsOptions, encode};
use litetex_exporters::{AssetCamera, Provenance, Quality, SplatAsset};
use litetex_gs::Report;
use litetex_gs::Result;
use litetex_gs::backend::Backend;
use litetex_gs::bake::{asset_camera, bake};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::Model;
use litetex_gs::rounding::Rounder;
use litetex_gs::train::{
    Control, MOST_STEPS, StepCosts, Timing, TrainConfig, TrainEvent, TrainState, train_by,
};
use litetex_gs::verify::FileRounder;
use litetex_gs::views::ViewSource as _;

/// Less than with the finest steps, which take 11,371 bytes.
const MAX_BYTES: u64 = 10_000;

fn cameras(views: &MemoryViews) -> Vec<AssetCamera> {
    (0..views.num_views()).map(|v| asset_camera(&format!("{v}.png"), v == 0, &views.camera(v))).collect()
}

fn statistics() -> Result<Box<dyn Backend>> {
    Ok(Box::new(CpuBackend::new(Some(2))?))
}

fn rounder(views: &MemoryViews, max_bytes: u64) -> Result<FileRounder<'static>> {
    let frame = SplatAsset { cameras: cameras(views), ..SplatAsset::default() };
    FileRounder::new(frame, max_bytes, &statistics, &|| true)
}

/// Trains, with rounding or without, and returns the final state and every checkpoint.
fn run(config: &TrainConfig, views: &MemoryViews, start: TrainState) -> (TrainState, Vec<TrainState>) {
    let mut saved = Vec::new();
    let mut sink = |event: TrainEvent<'_>| {
        if let TrainEvent::Checkpoint { state, .. } = event {
            saved.push(state.clone());
        }
        Ok(Control::Continue)
    };
    let timing = Timing {
        now: &|| 0.0,
        deadline_secs: None,
        most_steps: MOST_STEPS,
        costs: StepCosts::CPU,
        end_secs: 0.0,
    };
    let mut rounder = config.max_bytes.map(|most| rounder(views, most).unwrap());
    let rounder = rounder.as_mut().map(|rounder| rounder as &mut dyn Rounder);
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    let (state, _) = train_by(&timing, config, &mut backend, rounder, views, start, &mut sink).unwrap();
    (state, saved)
}

/// A run of 200 steps whose last part is rounded.
fn sized() -> TrainConfig {
    TrainConfig { max_bytes: Some(MAX_BYTES), ..config(200) }
}

fn asset(model: &Model, views: &MemoryViews) -> SplatAsset {
    bake(model, cameras(views), [0.0; 3], Provenance::default(), &mut Report::default())
}

/// Numbers of each kind that differ by more than the rounding of activations. Needed: 1e-6, but 6.4e-5 for SH, of one splat, which was
/// not explained.
fn differing(a: &Model, b: &Model) -> [usize; 6] {
    let count = |a: &[f32], b: &[f32], tolerance: f32| {
        let differ = |(a, b): (&f32, &f32)| (a - b).abs() > tolerance * a.abs().max(0.1);
        a.iter().zip(b).filter(|&pair| differ(pair)).count()
    };
    let [a_splats, b_splats] = [&a.splats, &b.splats];
    [
        count(&a_splats.positions, &b_splats.positions, 1e-5),
        count(&a_splats.quaternions, &b_splats.quaternions, 1e-5),
        count(&a_splats.log_scales, &b_splats.log_scales, 1e-5),
        count(&a_splats.opacity_logits, &b_splats.opacity_logits, 1e-5),
        count(&a_splats.sh, &b_splats.sh, 1e-3),
        count(&a.textures.texels, &b.textures.texels, 1e-5),
    ]
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
