//! Results do not depend on the position, rotation or units of a capture, the order of points and images in its files,
//! or the names of its images.

#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::moved::{Change, Sample};
use glam::{DMat3, DQuat, DVec3};
use litetex_gs::capture::{Capture, LoadOptions};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::init::{InitInput, InitOptions, InitPoints, initial_model};
use litetex_gs::model::Model;
use litetex_gs::sample::SampleOptions;
use litetex_gs::train::{Control, RateConfig, TrainConfig, TrainState, train};
use std::path::Path;

const STEPS: u32 = 100;

/// 24 views, 3 of them held out.
fn sample() -> Sample {
    let options = SampleOptions {
        views: 24,
        width_px: 96,
        height_px: 72,
        points: 700,
        supersampling: 2,
        ..SampleOptions::default()
    };
    Sample::new(&options)
}

fn turned() -> DMat3 {
    DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.7).normalize(), 2.4))
}

/// Every change of where the capture is.
fn changes() -> [(&'static str, Change); 4] {
    let shift = DVec3::new(1e6, -1e6, 5e5);
    [
        ("turned", Change { rotation: turned(), ..Change::NONE }),
        ("scaled", Change { scale: 1e3, ..Change::NONE }),
        ("shifted", Change { shift, ..Change::NONE }),
        ("all", Change { rotation: turned(), scale: 1e3, shift, disorder: true, ..Change::NONE }),
    ]
}

fn load(folder: &Path) -> Capture {
    Capture::load(folder, &LoadOptions::default()).unwrap()
}

fn first_model(capture: &Capture, seed: u64) -> Model {
    let input = InitInput {
        views: capture,
        points: InitPoints::Sparse(&capture.points),
        points_file: &capture.poses,
        capture_from_local: capture.capture_from_local,
        near: capture.near,
    };
    initial_model(&input, &InitOptions { sh_degree: 2, seed, ..InitOptions::default() }).unwrap().model
}

/// The model at the end and its PSNR.
fn trained(folder: &Path, seed: u64) -> (Model, f64) {
    let capture = load(folder);
    // Adam's steps are along the axes of the frame, and longer ones take splats further apart in a turned one (at 30
    // times the published rates 0.47 of their spacing, at the same PSNR), which would hide errors of the frame.
    let rates = RateConfig::published();
    let config = TrainConfig { steps: STEPS, sh_degree: 2, seed, rates, ..TrainConfig::default() };
    let start = TrainState::fresh(first_model(&capture, seed));
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    let (state, _) = train(&config, &mut backend, &capture, start, &mut |_| Ok(Control::Continue)).unwrap();
    let psnr = state.history.curve.last().unwrap().psnr_test;
    (state.model, psnr)
}

/// Centres in the frame of the capture.
fn exported(model: &Model) -> Vec<DVec3> {
    let place = |p: &[f32]| DVec3::new(p[0].into(), p[1].into(), p[2].into());
    let centres = model.splats.positions.chunks_exact(3).map(place);
    centres.map(|p| model.capture_from_local.transform_point(p)).collect()
}

/// For each place the nearest of others.
fn nearest(places: &[DVec3], others: &[DVec3]) -> Vec<(usize, f64)> {
    let of = |p: &DVec3| {
        let distances = others.iter().enumerate().map(|(i, o)| (i, o.distance(*p)));
        distances.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
    };
    places.iter().map(of).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn order_and_names_of_points_and_images_change_no_bit() {
    let sample = sample();
    let plain = sample.changed("plain", &Change::NONE);
    let other = sample.changed("other", &Change::NONE.with_disorder(true));
    let names = |folder: &Path| load(folder).views.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    assert_ne!(names(&plain), names(&other));
    let (expected, psnr) = trained(&plain, 42);
    let (found, psnr_found) = trained(&other, 42);
    assert!(expected == found, "{} and {} splats", expected.num_splats(), found.num_splats());
    // The mean over the views adds them in another order.
    assert!((psnr - psnr_found).abs() < 1e-9, "{psnr} {psnr_found}");
    // Negative control.
    assert!(trained(&plain, 43).0 != expected);
}

#[test]
fn the_initial_model_follows_rotation_translation_and_scale_of_the_capture() {
    let sample = sample();
    let model_of = |name: &str, change: &Change| first_model(&load(&sample.changed(name, change)), 42);
    let plain = model_of("plain", &Change::NONE);
    let axes = |model: &Model| -> Vec<DMat3> {
        let quaternion = |q: &[f32]| {
            DMat3::from_quat(DQuat::from_xyzw(q[1].into(), q[2].into(), q[3].into(), q[0].into()).normalize())
        };
        model.splats.quaternions.chunks_exact(4).map(quaternion).collect()
    };
    let (centres, plain_axes) = (exported(&plain), axes(&plain));
    for (name, change) in changes() {
        let model = model_of(name, &change);
        assert_eq!(model.num_splats(), plain.num_splats());
        // How far off, in units of the cameras' extent, and how much turned.
        let off = |change: &Change| {
            let back: Vec<DVec3> = exported(&model).iter().map(|&p| change.origin(p)).collect();
            let axes = axes(&model);
            let pairs = nearest(&back, &centres);
            let places = pairs.iter().map(|p| p.1).fold(0.0, f64::max) / plain.capture_from_local.scale;
            let turns = pairs.iter().enumerate().map(|(i, &(j, _))| {
                let difference = change.rotation.transpose() * axes[i] - plain_axes[j];
                difference.to_cols_array().into_iter().fold(0.0, |m: f64, v| m.max(v.abs()))
            });
            (places, turns.fold(0.0, f64::max))
        };
        let (places, turns) = off(&change);
        println!("{name}: {places:.1e} of the extent, axes {turns:.1e}");
        // f32 in the local frame: needed 2e-7 and 3e-7.
        assert!(places < 1e-6 && turns < 2e-6, "{name}: {places} {turns}");
        let slightly = DMat3::from_rotation_x(1e-4);
        let control = off(&Change { rotation: slightly * change.rotation, ..change });
        assert!(control.0 > 1e-5 && control.1 > 1e-5, "negative control: {control:?}");
    }
}

/// Seeds over which figures are averaged: single runs of the turned capture differ by up to 0.09 dB, their mean by
/// 0.003 dB.
const SEEDS: [u64; 4] = [1, 2, 3, 4];

/// Typical distance of neighbours, in units of the cameras' extent.
fn spacing(model: &Model) -> f64 {
    let centres = exported(model);
    let to_nearest = |(i, c): (usize, &DVec3)| {
        let others = centres.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, o)| o.distance(*c)).fold(f64::INFINITY, f64::min)
    };
    median(centres.iter().enumerate().map(to_nearest).collect()) / model.capture_from_local.scale
}

#[test]
fn quality_does_not_depend_on_the_captures_frame() {
    let sample = sample();
    let folder = sample.changed("plain", &Change::NONE);
    let plain = SEEDS.map(|seed| trained(&folder, seed));
    let extent = plain[0].0.capture_from_local.scale;
    for (name, change) in changes() {
        let folder = sample.changed(name, &change);
        let [mut decibels, mut splats] = [0.0; 2];
        for (seed, (expected, psnr)) in SEEDS.into_iter().zip(&plain) {
            let (model, found) = trained(&folder, seed);
            decibels += (found - psnr) / SEEDS.len() as f64;
            splats += (model.num_splats() as f64 / expected.num_splats() as f64 - 1.0) / SEEDS.len() as f64;
            let centres = exported(expected);
            let off = |change: &Change| {
                let back: Vec<DVec3> = exported(&model).iter().map(|&p| change.origin(p)).collect();
                let distances = nearest(&back, &centres).into_iter().map(|p| p.1 / extent);
                median(distances.collect()) / spacing(expected)
            };
            let slightly = DMat3::from_rotation_x(0.15);
            let [off, control] =
                [change, Change { rotation: slightly * change.rotation, ..change }].map(|c| off(&c));
            println!(
                "{name}: {psnr:.2} {found:.2} dB, centres off by {off:.3} of their spacing, control {control:.2}"
            );
            // Steps of Adam along axes that are turned against the capture take splats a part of their size apart.
            // Needed 0.17, and 0 where nothing is turned.
            assert!(off < 0.25, "{name}: {off}");
            assert!(control > 0.5, "negative control, nine degrees off: {name}: {control}");
        }
        println!("{name}: {decibels:+.3} dB, {:+.2} % splats", 100.0 * splats);
        assert!(decibels.abs() < 0.1, "{name}: {decibels} dB");
        assert!(splats.abs() < 0.03, "{name}: {splats}");
    }
    // Negative control: a capture whose scale is not that of its cameras is another one.
    let other = sample.changed("other", &Change { points_scale: 1.1, ..Change::NONE });
    let worse: f64 = SEEDS.iter().zip(&plain).map(|(&seed, (_, psnr))| psnr - trained(&other, seed).1).sum();
    println!("points scaled alone: {:+.3} dB", -worse / SEEDS.len() as f64);
    assert!(worse / SEEDS.len() as f64 > 0.1, "{worse}");
}
