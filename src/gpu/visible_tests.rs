//! A splat that a view does not see costs an invocation of `project` and of no other kernel, and takes its step of Adam all
//! the same; the number of dispatches of a step.

use super::device::{GpuDevice, LimitChoice};
use super::encode::Dispatch;
use super::fault_tests::{backend, request};
use super::form::GpuOptions;
use super::harness::test_drivers;
use super::kernels::{Buf, Groups, KernelId, NUM_GROUPS};
use super::layout::{DispatchArgs, PAIR_SUMS_STATISTICS};
use super::resources::UniformOffsets;
use super::shader::{BLOCK, GROUP};
use super::sort::folded_groups;
use super::state::GpuBackend;
use crate::backend::{Backend as _, LearningRates, StepRequest};
use crate::camera::Camera;
use crate::model::{AdamState, Model, SplatGroup};
use crate::reference::adam_dense;
use crate::selftest::{RandomScene, SceneOptions, random_scene};

const RATES: LearningRates = LearningRates {
    position: 1e-3,
    quaternion: 2e-3,
    log_scale: 5e-3,
    opacity: 2e-2,
    sh_dc: 2e-3,
    sh_rest: 1e-4,
    texel: 1e-2,
    texel_growth: 0.0,
    texel_growth_limit: 1.0,
};

/// Largest difference from dense Adam in f64, relative to parameters of 1 or more: needed 1.1e-7.
const ROUNDING: f64 = 5e-7;

/// More splats than a group, and cameras that see all, none and some of them.
fn scene_and_cameras() -> (RandomScene, [Camera; 3]) {
    let options = SceneOptions { num_splats: 700, width_px: 48, height_px: 40, ..SceneOptions::default() };
    let scene = random_scene(&options);
    let (mut away, mut aside) = (scene.camera, scene.camera);
    away.camera_from_local.translation.z -= 1e3;
    aside.pinhole.cx_px += 24.0;
    let cameras = [scene.camera, away, aside];
    (scene, cameras)
}

fn step_of<'a>(scene: &'a RandomScene, cameras: &[Camera], step: u32) -> StepRequest<'a> {
    let camera = cameras[(step as usize - 1) % cameras.len()];
    StepRequest { camera, rates: RATES, ..request(scene, step) }
}

#[test]
fn kernels_after_the_projection_are_dispatched_for_visible_splats_only() {
    let (scene, cameras) = scene_and_cameras();
    let n = scene.model.num_splats() as u32;
    if let Some(mut backend) = backend() {
        let mut counts = Vec::new();
        for camera in cameras {
            backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
            let report = backend.step(&step_of(&scene, &[camera], 1)).unwrap();
            let seen = report.counters.visible_splats as u32;
            let args: Vec<DispatchArgs> =
                backend.device.read(backend.resources.buffer(Buf::Args), NUM_GROUPS as usize).unwrap();
            for (groups, count) in [
                (Groups::Splats, n.div_ceil(GROUP)),
                (Groups::EachListed, seen),
                (Groups::EachVisible, seen),
                (Groups::Visible, seen.div_ceil(GROUP)),
                (Groups::VisibleBlocks, seen.div_ceil(BLOCK)),
                (Groups::VisibleTotals, (seen * PAIR_SUMS_STATISTICS).div_ceil(GROUP)),
            ] {
                assert_eq!(args[groups as usize], folded_groups(count), "{groups:?}, {seen} of {n} splats");
            }
            let (_, adam) = backend.read_back().unwrap();
            let stepped = adam.last_step.iter().filter(|&&step| step == 1).count();
            assert_eq!(stepped as u32, seen, "splats with a last step");
            counts.push(seen);
        }
        println!("{counts:?} of {n} splats visible");
        assert!(counts[0] > counts[2] && counts[2] > GROUP && counts[1] == 0, "{counts:?}");
        for dispatch in all_dispatches(&backend, &scene.camera).concat() {
            let by_splat = [Groups::Splats, Groups::EachSplat].contains(&dispatch.groups);
            let projects = [KernelId::Project, KernelId::ProjectGeometry].contains(&dispatch.kernel);
            assert_eq!(by_splat, projects, "{dispatch:?}");
        }
    }
}

/// The dispatches of steps with and without depths and normals, and with and without exposures.
fn all_dispatches(backend: &GpuBackend, camera: &Camera) -> [Vec<Dispatch>; 4] {
    [(false, false), (true, false), (false, true), (true, true)].map(|(geometry, exposure)| {
        backend.step_dispatches(&[UniformOffsets::default()], camera, geometry, true, exposure)
    })
}

#[test]
fn a_step_takes_few_dispatches() {
    let (scene, _) = scene_and_cameras();
    // The same on any driver.
    if let Some(backend) = backend() {
        let mut camera = scene.camera;
        // Two passes of the sort by tile, up to 65,535 tiles.
        (camera.pinhole.width_px, camera.pinhole.height_px) = (1067, 1899);
        assert_eq!(all_dispatches(&backend, &camera).map(|d| d.len()), [29, 30, 32, 33]);
        (camera.pinhole.width_px, camera.pinhole.height_px) = (6000, 4000);
        assert_eq!(all_dispatches(&backend, &camera).map(|d| d.len()), [31, 32, 34, 35]);
    }
}

/// Model and moments after steps that use these cameras in turn, with the batches of the options.
fn trained(
    backend: &mut GpuBackend,
    scene: &RandomScene,
    cameras: &[Camera],
    steps: u32,
    options: GpuOptions,
) -> (Model, AdamState) {
    backend.set_options(options).unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let requests: Vec<_> = (1..=steps).map(|step| step_of(scene, cameras, step)).collect();
    backend.steps(&requests).unwrap();
    backend.read_back().unwrap()
}

fn batches_of(steps: usize) -> GpuOptions {
    GpuOptions { batch_steps: Some(steps), ..GpuOptions::default() }
}

#[test]
fn invisible_splats_take_every_step_of_adam() {
    let (scene, [all, away, _]) = scene_and_cameras();
    if let Some(mut backend) = backend() {
        let (before, adam) = trained(&mut backend, &scene, &[all], 1, batches_of(1));
        let (after, _) = trained(&mut backend, &scene, &[all, away, away], 3, batches_of(2));
        let of = |arrays: &crate::model::SplatArrays, group, i: usize| f64::from(arrays.group(group)[i]);
        let rates = [RATES.position, RATES.quaternion, RATES.log_scale, RATES.opacity];
        let (mut moved, mut worst) = (0, 0.0_f64);
        for (&group, rate) in SplatGroup::ALL.iter().zip(rates) {
            for i in 0..before.splats.group(group).len() {
                let first = of(&before.splats, group, i);
                let mut state = (first, of(&adam.splats_m, group, i), of(&adam.splats_v, group, i));
                for step in 2..=3 {
                    state = adam_dense(state, 0.0, rate.into(), step);
                }
                let (got, change) = (of(&after.splats, group, i), state.0 - first);
                let size = first.abs().max(1.0);
                worst = worst.max((got - state.0).abs() / size);
                moved += usize::from(change.abs() > 10.0 * ROUNDING * size);
            }
        }
        println!("{worst} of a parameter, {moved} moved");
        assert!(worst <= ROUNDING, "{worst}");
        assert!(moved > 1000, "negative control: {moved} parameters would differ without these steps");
    }
}

#[test]
fn batches_and_repeated_steps_change_no_bit() {
    let (scene, cameras) = scene_and_cameras();
    let [all, away, aside] = cameras;
    // Other drivers: tests/train_gpu.rs.
    if let (Some(mut backend), Some(mut small)) = (backend(), backend()) {
        let cameras = [aside, all, away];
        let one = trained(&mut backend, &scene, &cameras, 7, batches_of(1));
        assert!(trained(&mut backend, &scene, &cameras, 7, batches_of(3)) == one, "batches of 3");
        backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        let first = backend.step(&step_of(&scene, &cameras, 1)).unwrap();
        // The pairs of the first step fit, those of the second do not: it is repeated with the rest of its batch.
        let capacity = GpuOptions { pair_capacity: Some(first.counters.tile_pairs), ..batches_of(16) };
        assert!(trained(&mut small, &scene, &cameras, 7, capacity) == one, "repeated steps");
        let others = trained(&mut backend, &scene, &[all, aside, away], 7, batches_of(1));
        assert!(others != one, "negative control: other views");
    }
}

/// A buffer's limit at which the partial sums of a view's pairs need several turns.
const SMALL: LimitChoice = LimitChoice::Buffers(120_000);

#[test]
fn pairs_beyond_one_binding_train_the_same_bytes() {
    let options = SceneOptions {
        num_splats: 400,
        width_px: 64,
        height_px: 40,
        scales: (0.1, 0.5),
        map_sizes: vec![(4, 4)],
        ..SceneOptions::default()
    };
    let scene = random_scene(&options);
    let cameras = [scene.camera];
    for choice in test_drivers().into_iter().take(1) {
        for hardware in [false, true] {
            let open = |limits| {
                let options = GpuOptions { hardware_kernels: Some(hardware), ..batches_of(2) };
                GpuBackend::new(GpuDevice::open(&choice, limits).unwrap(), options).unwrap()
            };
            let [mut plenty, mut small] = [LimitChoice::Downlevel, SMALL].map(open);
            let options = small.options;
            let expected = trained(&mut plenty, &scene, &cameras, 5, options);
            assert!(trained(&mut small, &scene, &cameras, 5, options) == expected);
            let step = small.step(&step_of(&scene, &cameras, 6)).unwrap();
            let (pairs, fit) = (step.counters.tile_pairs, small.capacity.partial_pairs(PAIR_SUMS_STATISTICS));
            println!("{pairs} pairs, sums of {fit} at a time");
            assert!(pairs > fit, "several turns");
            assert!(
                trained(&mut small, &scene, &cameras, 4, options) != expected,
                "negative control: a step less"
            );
            let one = plenty.capacity.partial_pairs(PAIR_SUMS_STATISTICS);
            assert!(one >= pairs, "one round on the other device");
        }
    }
}
