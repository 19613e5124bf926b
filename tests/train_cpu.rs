//! The trainer with the CPU backend, on views from memory instead of files.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::training::{BLACK, MemoryViews, config, damaged, photos, scene, scene_options, uploaded};
use litetex_gs::backend::{
    Backend as _, DensityPlan, Grid, LearningRates, LossWeights, MapChange, RenderOptions, StepRequest,
    TargetImage, WindowStatistics,
};
use litetex_gs::camera::Camera;
use litetex_gs::constants::SH_0;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{Filter, TextureMap, TexturePool, texel_value};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};
use litetex_gs::train::{Control, StopReason, TrainConfig, TrainEvent, TrainState, train};
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};
use std::sync::Arc;

/// Trains, and returns the final state and every checkpoint.
fn run(config: &TrainConfig, views: &MemoryViews, start: TrainState) -> (TrainState, Vec<TrainState>) {
    let mut saved = Vec::new();
    let mut sink = |event: TrainEvent<'_>| {
        if let TrainEvent::Checkpoint { state, .. } = event {
            saved.push(state.clone());
        }
        Ok(Control::Continue)
    };
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    let (state, reason) = train(config, &mut backend, views, start, &mut sink).unwrap();
    assert_eq!(reason, StopReason::Steps);
    (state, saved)
}

#[test]
fn training_recovers_a_damaged_scene() {
    let scene = scene();
    let views = photos(&scene);
    let (state, _) = run(&config(400), &views, TrainState::fresh(damaged(&scene)));
    let curve: Vec<f64> = state.history.curve.iter().map(|p| p.psnr_test).collect();
    println!("{curve:?}");
    assert_eq!(curve.len(), 2);
    // The damaged scene starts near 12 dB on the test view.
    assert!(curve[1] > 25.0 && curve[1] > curve[0], "{curve:?}");
}

#[test]
fn resuming_anywhere_continues_bit_for_bit() {
    let scene = scene();
    let views = photos(&scene);
    let config = config(30);
    let (whole, saved) = run(&config, &views, TrainState::fresh(damaged(&scene)));
    let steps: Vec<u32> = saved.iter().map(|s| s.step).collect();
    // Epochs have 5 views and density control runs every 5 steps: the checkpoints fall within both. The final
    // state is saved before and after its evaluation.
    assert_eq!(steps, [7, 14, 21, 28, 30, 30]);
    let revised = |s: &TrainState| s.model.textures.maps != saved[0].model.textures.maps;
    assert!(revised(&whole), "no map changed: nothing was tested");
    for start in &saved[..4] {
        let (resumed, _) = run(&config, &views, start.clone());
        assert!(resumed.model == whole.model && resumed.adam == whole.adam, "from step {}", start.step);
        assert_eq!((resumed.epochs, resumed.epoch_used), (whole.epochs, whole.epoch_used));
    }
    // Negative control: a state that differs in one bit ends differently.
    let mut other = saved[0].clone();
    other.model.splats.positions[0] = f32::from_bits(other.model.splats.positions[0].to_bits() ^ 1);
    assert!(run(&config, &views, other).0.model != whole.model);
}

#[test]
fn the_consumer_stops_training_with_a_checkpoint() {
    let scene = scene();
    let views = photos(&scene);
    let mut last_saved = 0;
    let mut sink = |event: TrainEvent<'_>| match event {
        TrainEvent::Step { step: 11, .. } => Ok(Control::Stop),
        TrainEvent::Checkpoint { state, .. } => {
            last_saved = state.step;
            Ok(Control::Continue)
        }
        _ => Ok(Control::Continue),
    };
    let mut backend = CpuBackend::new(Some(1)).unwrap();
    let start = TrainState::fresh(damaged(&scene));
    let (state, reason) = train(&config(30), &mut backend, &views, start, &mut sink).unwrap();
    assert_eq!((state.step, reason), (11, StopReason::Consumer));
    assert_eq!(last_saved, 11);
}

#[test]
fn snapshots_change_no_bit_of_the_training() {
    let scene = scene();
    let views = photos(&scene);
    let outcome = |every: u32| {
        let (mut taken, mut saved) = (Vec::new(), None);
        let mut sink = |event: TrainEvent<'_>| {
            match event {
                TrainEvent::Step { step, .. } if every > 0 && step % every == 0 => {
                    return Ok(Control::Snapshot);
                }
                TrainEvent::Snapshot { step, model, .. } => taken.push((step, model)),
                TrainEvent::Checkpoint { state, .. } => saved = Some(state.model.clone()),
                // Outside of steps, the answer asks for nothing.
                TrainEvent::Started { .. } | TrainEvent::Evaluated { .. } if every > 0 => {
                    return Ok(Control::Snapshot);
                }
                _ => {}
            }
            Ok(Control::Continue)
        };
        let mut backend = CpuBackend::new(Some(1)).unwrap();
        let start = TrainState::fresh(damaged(&scene));
        let (state, reason) = train(&config(30), &mut backend, &views, start, &mut sink).unwrap();
        assert_eq!((state.step, reason), (30, StopReason::Steps));
        (state, taken, saved.unwrap())
    };
    let (plain, none, _) = outcome(0);
    let (watched, taken, saved) = outcome(4);
    assert!(none.is_empty() && watched.model == saved);
    assert!(watched.model == plain.model && watched.adam == plain.adam);
    assert_eq!(taken.iter().map(|(step, _)| *step).collect::<Vec<_>>(), [4, 8, 12, 16, 20, 24, 28]);
    assert!(taken.windows(2).all(|pair| pair[0].1 != pair[1].1), "they differ from step to step");
}

#[test]
fn without_training_views_training_is_a_usage_error() {
    let scene = scene();
    let views = MemoryViews(photos(&scene).0[..1].to_vec());
    let start = TrainState::fresh(scene.model);
    let mut backend = CpuBackend::new(Some(1)).unwrap();
    let outcome = train(&config(3), &mut backend, &views, start, &mut |_| Ok(Control::Continue));
    assert!(matches!(outcome, Err(Error::Usage(_))));
}

#[test]
fn fully_masked_test_views_are_not_evaluated() {
    let scene = scene();
    let mut views = photos(&scene);
    for (_, target) in &mut views.0 {
        *target = Arc::new(TargetImage { mask: Some(vec![0; 64 * 48]), ..(**target).clone() });
    }
    let (mut warned, mut evaluated) = (0, 0);
    let mut sink = |event: TrainEvent<'_>| {
        warned += usize::from(matches!(event, TrainEvent::Warning(_)));
        evaluated += usize::from(matches!(event, TrainEvent::Evaluated { .. }));
        Ok(Control::Continue)
    };
    let mut backend = CpuBackend::new(Some(1)).unwrap();
    let start = TrainState::fresh(damaged(&scene));
    let (state, _) = train(&config(4), &mut backend, &views, start, &mut sink).unwrap();
    assert_eq!((warned, evaluated, state.history.curve.len()), (2, 0, 0));
}

#[test]
fn a_random_background_supervises_alpha() {
    let scene = scene();
    let mut views = photos(&scene);
    // A black object: over a black background nothing tells it from emptiness.
    let alpha: Vec<u8> = (0..64 * 48).map(|i| if i % 64 < 32 { 127 } else { 0 }).collect();
    for (camera, target) in &mut views.0 {
        camera.camera_from_local = scene.camera.camera_from_local;
        let rgb = vec![0; 3 * 64 * 48];
        *target = Arc::new(TargetImage { rgb, alpha: Some(alpha.clone()), ..(**target).clone() });
    }
    // Mean brightness over white of the halves that show the object and nothing.
    let trained = |random_background: bool| {
        let config = TrainConfig { random_background, eval_every: 0, save_every: 0, ..config(300) };
        let (state, _) = run(&config, &views, TrainState::fresh(damaged(&scene)));
        let white = RenderOptions { background: [1.0; 3], ..BLACK };
        let image = uploaded(&state.model).render(&scene.camera, &white).unwrap();
        let half = |first: usize| {
            let pixels = image.rgb.chunks_exact(3).enumerate().filter(|(i, _)| i % 64 / 32 == first);
            pixels.map(|(_, p)| f64::from(p[1])).sum::<f64>() / (32.0 * 48.0)
        };
        (half(0), half(1))
    };
    let (object, nothing) = trained(true);
    assert!(object < 0.25 && nothing > 0.75, "{object} {nothing}");
    let (object, nothing) = trained(false);
    assert!(object > 0.25 || nothing < 0.75, "negative control: {object} {nothing}");
}

/// Views of which the test view's photo cannot be read.
struct Unreadable(MemoryViews);

impl ViewSource for Unreadable {
    fn num_views(&self) -> usize {
        self.0.num_views()
    }
    fn name(&self, view: usize) -> &str {
        self.0.name(view)
    }
    fn split(&self, view: usize) -> Split {
        self.0.split(view)
    }
    fn camera(&self, view: usize) -> Camera {
        self.0.camera(view)
    }
    fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
        if view == 0 { Err(Error::invalid("held-out.png", "cut off")) } else { self.0.target(view) }
    }
}

#[test]
fn an_unreadable_test_photo_does_not_lose_the_training() {
    let scene = scene();
    let views = Unreadable(photos(&scene));
    for eval_every in [0, 5] {
        let mut saved = 0;
        let mut sink = |event: TrainEvent<'_>| {
            if let TrainEvent::Checkpoint { state, .. } = event {
                saved = state.step;
            }
            Ok(Control::Continue)
        };
        let config = TrainConfig { eval_every, save_every: 0, ..config(8) };
        let mut backend = CpuBackend::new(Some(1)).unwrap();
        let start = TrainState::fresh(damaged(&scene));
        let outcome = train(&config, &mut backend, &views, start, &mut sink);
        assert!(matches!(outcome, Err(Error::InvalidInput { .. })));
        assert_eq!(saved, if eval_every == 0 { 8 } else { 5 });
    }
}

fn step(backend: &mut CpuBackend, views: &MemoryViews, step: u32) {
    let (camera, target) = &views.0[1 + step as usize % 5];
    let rates = LearningRates { position: 1e-3, sh_dc: 1e-2, texel: 1e-2, ..LearningRates::default() };
    let loss =
        LossWeights { l1: 0.8, dssim: 0.2, mse: 0.0, opacity: 0.01, texture: 1e-8, ..LossWeights::NONE };
    let request = StepRequest {
        step,
        camera: *camera,
        photo: Some(1 + step % 5),
        target,
        background: [0.0; 3],
        sh_degree: 1,
        loss,
        rates,
        accumulate_statistics: true,
        exposure: None,
    };
    backend.step(&request).unwrap();
}

#[test]
fn rendering_during_training_does_not_change_it() {
    let scene = scene();
    let views = photos(&scene);
    let (mut plain, mut watched) = (uploaded(&damaged(&scene)), uploaded(&damaged(&scene)));
    for t in 1..=6 {
        step(&mut plain, &views, t);
        step(&mut watched, &views, t);
        watched.render(&scene.camera, &RenderOptions { geometry: true, ..BLACK }).unwrap();
        watched.read_flushed().unwrap();
    }
    assert!(plain.read_back().unwrap() == watched.read_back().unwrap());
}

#[test]
fn statistics_are_summed_over_a_window_and_can_be_reset() {
    let scene = scene();
    let views = photos(&scene);
    let mut backend = uploaded(&damaged(&scene));
    let mut sum = vec![0.0_f32; 300];
    let mut apart = uploaded(&damaged(&scene));
    for t in 1..=3 {
        step(&mut backend, &views, t);
        step(&mut apart, &views, t);
        let one = apart.read_statistics().unwrap();
        apart.set_statistics(&WindowStatistics::empty(one.seen.len())).unwrap();
        assert_eq!(one.views, 1);
        sum.iter_mut().zip(&one.contribution).for_each(|(s, c)| *s += c);
    }
    let window = backend.read_statistics().unwrap();
    assert_eq!((window.views, window.seen.iter().max()), (3, Some(&3)));
    assert_eq!(window.contribution, sum);
    assert!(sum.iter().sum::<f32>() > 0.5, "the splats cover most of the image");
    assert_eq!(backend.read_statistics().unwrap(), window, "reading does not change them");
}

#[test]
fn plans_gather_splats_and_resample_maps() {
    let scene = scene();
    let views = photos(&scene);
    let mut backend = uploaded(&scene.model);
    step(&mut backend, &views, 1);
    let before = backend.render(&scene.camera, &BLACK).unwrap();
    let (model, adam) = backend.read_back().unwrap();
    let n = model.num_splats() as u32;
    let reversed: Vec<u32> = (0..n).rev().collect();
    let plan = |sources: &[u32], change| DensityPlan {
        sources: sources.to_vec(),
        maps: vec![change; sources.len()],
        ..DensityPlan::default()
    };
    backend.apply_plan(&plan(&reversed, MapChange::Keep)).unwrap();
    let after = backend.render(&scene.camera, &BLACK).unwrap();
    // The order of storage does not matter, except for ties of depth.
    assert_eq!(before.rgb, after.rgb);
    backend.apply_plan(&plan(&reversed, MapChange::Keep)).unwrap();
    assert!(backend.read_back().unwrap() == (model.clone(), adam), "reversing twice restores the order");

    let half: Vec<u32> = (0..n).step_by(2).collect();
    let texel_sizes = model.textures.maps[0].texel_sizes;
    let change =
        MapChange::Resample { rows: 6, cols: 3, texel_sizes, shift_texels: [0.0; 2], moment_scale: [1.0; 2] };
    backend.apply_plan(&plan(&half, change)).unwrap();
    let (small, small_adam) = backend.read_back().unwrap();
    assert_eq!((small.num_splats(), small.num_texels()), (150, 150 * 18));
    assert_eq!(small_adam.texels_m.len(), small.textures.texels.len());
    assert_eq!(small.splats.positions[3..6], model.splats.positions[6..9]);

    let wrong = plan(&[n], MapChange::Keep);
    assert!(matches!(backend.apply_plan(&wrong), Err(Error::Usage(_))), "150 splats are left");
}

/// Images of the model before and after a change of all maps.
fn images_around(scene: &RandomScene, change: impl Fn(&TextureMap) -> MapChange) -> [Vec<f32>; 2] {
    let mut backend = uploaded(&scene.model);
    let before = backend.render(&scene.camera, &BLACK).unwrap();
    let maps = &scene.model.textures.maps;
    let plan = DensityPlan {
        sources: (0..maps.len() as u32).collect(),
        maps: maps.iter().map(change).collect(),
        ..DensityPlan::default()
    };
    backend.apply_plan(&plan).unwrap();
    [before.rgb, backend.render(&scene.camera, &BLACK).unwrap().rgb]
}

/// Largest difference between the images before and after a change of all maps.
fn difference_by(scene: &RandomScene, change: impl Fn(&TextureMap) -> MapChange) -> f32 {
    let [before, after] = images_around(scene, change);
    let difference = |(a, b): (&f32, &f32)| (a - b).abs();
    before.iter().zip(&after).map(difference).fold(0.0, f32::max)
}

fn margin(map: &TextureMap, texels: i32) -> MapChange {
    let with = |size: u16| (i32::from(size) + 2 * texels) as u16;
    MapChange::Regrid {
        grids: [Grid::Same; 2],
        rows: with(map.rows),
        cols: with(map.cols),
        first_row: -texels,
        first_col: -texels,
        shift: map.shift,
        moment_scale: [1.0; 2],
    }
}

#[test]
fn padding_with_zeros_does_not_change_images() {
    let mut scene = scene();
    // A margin of zeros around the inner 2 x 2 texels of each map.
    for (t, rgb) in scene.model.textures.texels.chunks_exact_mut(3).enumerate() {
        if [t / 4 % 4, t % 4].iter().any(|k| [0, 3].contains(k)) {
            rgb.fill(0.0);
        }
    }
    let same = |texels: i32| move |map: &TextureMap| margin(map, texels);
    for texels in [-1, 0, 1, 5] {
        let off = difference_by(&scene, same(texels));
        println!("margin {texels}: {off:e}");
        // The rounding of texture coordinates depends on the size of the map: needed 3e-7.
        assert!(if texels == 0 { off == 0.0 } else { off < 1e-6 }, "margin {texels}: {off:e}");
    }
    // Negative controls: maps without their inner texels, and shifted maps.
    assert!(difference_by(&scene, same(-2)) > 0.1);
    let shifted = |map: &TextureMap| MapChange::Regrid {
        grids: [Grid::Same; 2],
        rows: map.rows,
        cols: map.cols,
        first_row: 1,
        first_col: 0,
        shift: map.shift,
        moment_scale: [1.0; 2],
    };
    assert!(difference_by(&scene, shifted) > 0.1);
}

/// Each texel becomes 2 x 2; the window begins at row and column `first` of the finer grid.
fn doubled(first: i32) -> impl Fn(&TextureMap) -> MapChange {
    move |map| MapChange::Regrid {
        grids: [Grid::Finer; 2],
        rows: 2 * map.rows,
        cols: 2 * map.cols,
        first_row: first,
        first_col: first,
        shift: map.shift.map(|shift| 2 * shift),
        moment_scale: [0.25, 0.0625],
    }
}

/// Upper bound of the change of a sample in one channel when each texel becomes 2 x 2 texels of its value.
///
/// Along one axis, take texels with the values 0 and d at 0 and 1. Before, a sample at x is d x. After, there
/// are texels with 0 at -1/4 and 1/4 and with d at 3/4 and 5/4: samples are 0 up to 1/4, d from 3/4 on, and 2 d
/// (x - 1/4) in between. They differ by at most |d| / 4, at 1/4 and 3/4. The zeros outside the map are
/// neighbours like any others. Bilinear sampling handles one axis after the other, and each is a mean, which
/// does not increase differences: the bound is the sum over both axes.
fn doubling_bound(scene: &RandomScene, map: &TextureMap, channel: usize) -> f64 {
    let (rows, cols) = (i32::from(map.rows), i32::from(map.cols));
    let texels = &scene.model.textures.texels[map.floats()];
    let value = |row: i32, col: i32| {
        let inside = (0..rows).contains(&row) && (0..cols).contains(&col);
        if inside { texel_value(texels[3 * (row * cols + col) as usize + channel].into()) } else { 0.0 }
    };
    let (mut by_row, mut by_col) = (0.0_f64, 0.0_f64);
    for (row, col) in (-1..rows).flat_map(|row| (-1..cols).map(move |col| (row, col))) {
        by_row = by_row.max((value(row + 1, col) - value(row, col)).abs());
        by_col = by_col.max((value(row, col + 1) - value(row, col)).abs());
    }
    (by_row + by_col) / 4.0
}

#[test]
fn upsampling_changes_images_by_a_quarter_of_texel_differences() {
    // Few, opaque splats, so that most pixels are dominated by one.
    let mut scene = random_scene(&SceneOptions { num_splats: 30, opacities: (0.9, 0.99), ..scene_options() });
    // A chequerboard: all neighbours differ by the same amount.
    for (t, rgb) in scene.model.textures.texels.chunks_exact_mut(3).enumerate() {
        rgb.fill(if (t / 4 + t) % 2 == 0 { 0.5 } else { -0.5 });
    }
    // Blending weights do not depend on colours, and the clamp at zero does not increase differences. So the
    // change of a pixel is bounded by the blend of the splats' bounds: an image of splats with the bounds as
    // colours.
    let mut bounds = scene.model.clone();
    bounds.textures = TexturePool::neutral(vec![TextureMap::default(); bounds.num_splats()]).unwrap();
    bounds.splats.sh.fill(0.0);
    for (splat, map) in scene.model.textures.maps.iter().enumerate() {
        for (channel, colour) in bounds.splats.sh_of_mut(splat)[..3].iter_mut().enumerate() {
            *colour = ((doubling_bound(&scene, map, channel) - 0.5) / SH_0) as f32;
        }
    }
    let bounds = uploaded(&bounds).render(&scene.camera, &BLACK).unwrap().rgb;
    // Largest change of a pixel over its bound.
    let used = |first: i32| {
        let [before, after] = images_around(&scene, doubled(first));
        let parts = before.iter().zip(&after).zip(&bounds);
        // Allows for rounding: needed 0.
        parts.map(|((a, b), bound)| (a - b).abs() / (bound + 1e-6)).fold(0.0, f32::max)
    };
    let [used, left, right] = [0, 1, -1].map(used);
    println!("{used} of the bound, {left} and {right} with a shift");
    // The largest change is at positions a quarter of a texel from a centre along both axes: samples there have
    // a quarter of the texel's value before and all of it after, three quarters of the bound.
    assert!((0.7..1.0).contains(&used), "{used}");
    // Negative control: windows that begin one fine texel too late or too early.
    assert!(left > 1.1 && right > 1.1, "{left} {right}");
}

#[test]
fn upsampling_uniform_maps_does_not_change_images() {
    let mut scene = scene();
    // Splats that the filter widens end beyond their maps, where residuals fade out.
    scene.model.filter = Filter::None;
    // Moves the outermost texel centres, beyond which residuals fade out, outside the support.
    for map in &mut scene.model.textures.maps {
        let [u, v] = map.texel_sizes;
        (map.texel_sizes, map.shift) = ([1.5 * u.max(v); 2], [0; 2]);
    }
    scene.model.textures.texels.fill(0.6);
    let off = difference_by(&scene, doubled(0));
    println!("{off:e}");
    // Rounding of weights that sum to 1: needed 1.2e-7.
    assert!(off < 1e-6, "{off:e}");
    scene.model.textures.texels.fill(0.0);
    assert_eq!(difference_by(&scene, doubled(0)), 0.0);
    // Negative control: one texel of each map differs.
    scene.model.textures.texels.chunks_exact_mut(48).for_each(|map| map[15..18].fill(0.6));
    assert!(difference_by(&scene, doubled(0)) > 0.01);
}
