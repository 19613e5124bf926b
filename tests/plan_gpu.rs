//! Density-control plans and window statistics on the wgpu backend: as on the CPU backend, bit for bit where that is
//! specified.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::{backend, drivers_and_limits, open};
use common::plans::{State, agree, applied, keep};
use common::steps::{differences, plan, requests, scene, views};
use litetex_gs::Error;
use litetex_gs::backend::{Backend, DensityPlan, Grid, MapChange, WindowStatistics};
use litetex_gs::cpu::CpuBackend;
use litetex_gs::gpu::{AdapterChoice, GpuOptions, LimitChoice};
use litetex_gs::model::{AdamState, SplatGroup};
use litetex_gs::selftest::RandomScene;

/// A state after three steps, with everything flushed, so that applying a plan involves no updates.
fn flushed(scene: &RandomScene) -> State {
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    cpu.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    cpu.steps(&requests(&views(scene), 1..=3)).unwrap();
    let lagging = cpu.read_back().unwrap().1.last_step;
    assert!(lagging.iter().any(|&s| s != 3) && lagging.contains(&3));
    cpu.apply_plan(&keep(scene.model.num_splats())).unwrap();
    cpu.read_back().unwrap()
}

#[test]
fn plans_are_applied_as_on_the_cpu_on_every_driver() {
    let scene = scene(10);
    let start = flushed(&scene);
    let plan = plan(start.0.num_splats());
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let expected = applied(&mut cpu, &start, &plan);
    assert!(expected.0.num_texels() > 10_000 && plan.edits.len() > 50);
    for (driver, limits) in drivers_and_limits() {
        println!("{}", driver.name);
        let mut gpu = open(&driver, limits, GpuOptions::default());
        assert!(agree(&plan, &applied(&mut gpu, &start, &plan), &expected), "{}", driver.name);
        negative_controls(&mut gpu, &start, &plan, &expected);
    }
}

/// Plans that differ in a single number, or lack an edit, give a different state.
fn negative_controls(gpu: &mut dyn Backend, start: &State, plan: &DensityPlan, expected: &State) {
    let mut others = Vec::new();
    // Windows of the first copy of all changes that are neither empty nor outside their grid.
    let has_texels = |&at: &usize| start.0.textures.maps[plan.sources[at] as usize].num_texels() > 0;
    let windows: Vec<usize> = [1, 2, 3, 6, 7, 8, 9, 10, 11].into_iter().filter(has_texels).collect();
    assert!(windows.len() > 6);
    for at in windows {
        for k in 0..2 {
            let mut other = plan.clone();
            let MapChange::Regrid { first_row, moment_scale, .. } = &mut other.maps[at] else {
                unreachable!()
            };
            *first_row += 1 - k;
            moment_scale[1] *= 1.0 + 1e-4 * k as f32;
            others.push(other);
        }
    }
    let mut other = plan.clone();
    other.edits[3].log_scales[1] += 1e-6;
    others.push(other);
    let mut other = plan.clone();
    other.edits.remove(7);
    others.push(other);
    for other in others {
        assert!(!agree(plan, &applied(gpu, start, &other), expected), "{other:?}");
    }
}

#[test]
fn training_after_a_plan_follows_the_cpu_backend_on_every_driver() {
    drivers_and_limits()
        .iter()
        .for_each(|(driver, limits)| training_after_a_plan_follows_the_cpu_backend(driver, *limits));
}

fn training_after_a_plan_follows_the_cpu_backend(driver: &AdapterChoice, limits: LimitChoice) {
    let scene = scene(10);
    let start = flushed(&scene);
    let views = views(&scene);
    let plan = plan(start.0.num_splats());
    let mut gpu = open(driver, limits, GpuOptions::default());
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let mut ends = Vec::new();
    for backend in [&mut gpu as &mut dyn Backend, &mut cpu] {
        let (begin, _) = applied(backend, &start, &plan);
        backend.steps(&requests(&views, 4..=6)).unwrap();
        ends.push((begin, backend.read_flushed().unwrap()));
    }
    let [(_, g), (begin, c)] = ends.try_into().ok().unwrap();
    for (group, difference) in differences(&begin, &g, &c) {
        println!("{} {group}: {difference:.2e}", driver.name);
        // Needed 2.4e-2 for texels, because of new ones that get almost no gradient; 2e-3 for other texels, and 4e-5
        // for everything else.
        assert!(difference < 0.03, "{group}: {difference}");
    }
    let negative_control = differences(&begin, &begin, &c);
    assert!(negative_control.iter().all(|(_, d)| *d > 0.9), "{negative_control:?}");
}

#[test]
fn edits_zero_only_the_first_moments_of_their_splats() {
    let Some(mut gpu) = backend(GpuOptions::default()) else { return };
    let scene = scene(11);
    let start = flushed(&scene);
    let plan = plan(start.0.num_splats());
    let edited = applied(&mut gpu, &start, &plan);
    let plain = applied(&mut gpu, &start, &DensityPlan { edits: Vec::new(), ..plan.clone() });
    assert_eq!(edited.1.splats_v, plain.1.splats_v);
    assert_eq!((&edited.1.texels_m, &edited.1.texels_v), (&plain.1.texels_m, &plain.1.texels_v));
    for group in SplatGroup::ALL {
        let of = |state: &State, i: usize| {
            let moments = &state.1.splats_m;
            moments.group(group)[moments.range(group, i)].to_vec()
        };
        let mut moved = 0;
        for i in 0..plan.sources.len() {
            let is_edited = plan.edits.iter().any(|e| e.splat as usize == i);
            let before = of(&plain, i);
            moved += usize::from(is_edited && before.iter().any(|m| *m != 0.0));
            let expected = if is_edited { vec![0.0; before.len()] } else { before };
            assert_eq!(of(&edited, i), expected, "{group:?} of {i}");
        }
        assert!(moved > 20, "{group:?}: only {moved} edited splats had first moments");
    }
}

#[test]
fn a_plan_that_does_not_fit_changes_nothing() {
    for (driver, limits) in drivers_and_limits().into_iter().take(1) {
        assert_eq!(limits, LimitChoice::Downlevel);
        let mut gpu = open(&driver, limits, GpuOptions::default());
        let scene = scene(12);
        let n = scene.model.num_splats();
        gpu.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        gpu.steps(&requests(&views(&scene), 1..=5)).unwrap();
        let before = (gpu.read_back().unwrap(), gpu.read_statistics().unwrap());
        let mut plan = keep(n);
        // 192 MB of texels; buffers are limited to 128 MiB.
        plan.maps[n - 1] = MapChange::Regrid {
            grids: [Grid::Same; 2],
            rows: 4000,
            cols: 4000,
            first_row: 0,
            first_col: 0,
            shift: [0; 2],
            moment_scale: [1.0; 2],
        };
        assert!(matches!(gpu.apply_plan(&plan), Err(Error::DeviceFull(_))));
        assert!((gpu.read_back().unwrap(), gpu.read_statistics().unwrap()) == before);
        // Negative control: one that fits changes all of these.
        gpu.apply_plan(&keep(n)).unwrap();
        assert!(gpu.read_back().unwrap() != before.0 && gpu.read_statistics().unwrap() != before.1);
    }
}

#[test]
fn window_statistics_continue_from_where_they_were_read() {
    let cpu: Box<dyn Backend> = Box::new(CpuBackend::new(Some(2)).unwrap());
    let gpu = backend(GpuOptions::default()).map(|gpu| Box::new(gpu) as Box<dyn Backend>);
    let scene = scene(13);
    let views = views(&scene);
    for mut backend in std::iter::once(cpu).chain(gpu) {
        backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        backend.steps(&requests(&views, 1..=4)).unwrap();
        let (half, (model, adam)) = (backend.read_statistics().unwrap(), backend.read_back().unwrap());
        assert!(half.views == 1 && half.error.iter().any(|e| *e > 0.0));
        backend.steps(&requests(&views, 5..=9)).unwrap();
        let whole = backend.read_statistics().unwrap();
        assert_eq!((whole.views, whole.seen.iter().max()), (3, Some(&3)));
        // As when a run is resumed.
        backend.upload(&model, &adam).unwrap();
        let empty = WindowStatistics::empty(model.num_splats());
        assert_eq!(backend.read_statistics().unwrap(), empty);
        backend.set_statistics(&half).unwrap();
        assert_eq!(backend.read_statistics().unwrap(), half);
        backend.steps(&requests(&views, 5..=9)).unwrap();
        assert_eq!(backend.read_statistics().unwrap(), whole);
        // Negative control: without the first half.
        backend.upload(&model, &adam).unwrap();
        backend.steps(&requests(&views, 5..=9)).unwrap();
        assert_ne!(backend.read_statistics().unwrap(), whole);
        // Statistics of one splat too many are refused and change nothing.
        let before = backend.read_statistics().unwrap();
        let other = WindowStatistics::empty(model.num_splats() + 1);
        assert!(matches!(backend.set_statistics(&other), Err(Error::Usage(_))));
        assert_eq!(backend.read_statistics().unwrap(), before);
    }
}
