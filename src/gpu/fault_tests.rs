//! What is left after a step that failed while the device is alive; and what a call says that comes too early.

use super::backend::{GpuBackend, GpuOptions};
use super::device::{GpuDevice, LimitChoice};
use super::harness::test_drivers;
use super::kernels::Buf;
use crate::Error;
use crate::backend::{Backend as _, LearningRates, LossWeights, RenderOptions, StepRequest, TargetImage};
use crate::model::AdamState;
use crate::selftest::{RandomScene, SceneOptions, random_scene};

/// Backends on every software driver in turn.
pub(super) fn backends() -> impl Iterator<Item = GpuBackend> {
    test_drivers().into_iter().map(|choice| {
        println!("{}", choice.name);
        GpuBackend::new(GpuDevice::open(&choice, LimitChoice::Downlevel).unwrap(), GpuOptions::default())
            .unwrap()
    })
}

fn backend() -> Option<GpuBackend> {
    backends().next()
}

fn scene() -> RandomScene {
    let options = SceneOptions { num_splats: 100, width_px: 48, height_px: 40, ..SceneOptions::default() };
    random_scene(&options)
}

pub(super) fn request(scene: &RandomScene, step: u32) -> StepRequest<'_> {
    StepRequest {
        step,
        camera: scene.camera,
        photo: 0,
        target: &scene.target,
        background: [0.0; 3],
        sh_degree: 3,
        loss: LossWeights::PUBLISHED,
        rates: LearningRates { position: 1e-3, texel: 1e-2, ..LearningRates::default() },
        accumulate_statistics: true,
    }
}

/// Asks for something that no driver allows, outside of any call that would catch it.
fn refuse(backend: &GpuBackend) {
    let _ = backend.device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("refused"),
        size: 16,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    assert!(backend.device.check().is_err());
}

#[test]
fn what_was_applied_is_read_back_after_a_refusal_but_nothing_builds_on_it() {
    let Some(mut backend) = backend() else { return };
    let scene = scene();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    backend.steps(&[request(&scene, 1), request(&scene, 2)]).unwrap();
    let expected = backend.read_back().unwrap();
    let statistics = backend.read_statistics().unwrap();
    assert_eq!(expected.1.step, 2);
    refuse(&backend);
    assert!(backend.read_back().unwrap() == expected);
    let options = RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false };
    let errors = [
        backend.step(&request(&scene, 3)).err(),
        backend.render(&scene.camera, &options).err(),
        backend.read_flushed().err(),
    ];
    assert!(errors.iter().all(|e| matches!(e, Some(Error::Device(_)))), "{errors:?}");
    assert!(backend.read_back().unwrap() == expected, "those changed nothing");
    assert_eq!(backend.read_statistics().unwrap(), statistics, "a checkpoint needs them too");
    // Negative control: a device that is gone has nothing to give.
    backend.lose_device();
    assert!(matches!(backend.read_back(), Err(Error::Device(_))));
}

#[test]
fn steps_of_a_batch_whose_status_was_not_read_are_counted() {
    let Some(mut backend) = backend() else { return };
    let scene = scene();
    let adam = AdamState::zeros(&scene.model);
    backend.upload(&scene.model, &adam).unwrap();
    backend.steps(&[request(&scene, 1), request(&scene, 2)]).unwrap();
    let expected = backend.read_back().unwrap();
    backend.upload(&scene.model, &adam).unwrap();
    backend.steps(&[request(&scene, 1)]).unwrap();
    // The status of the second step cannot be read: its staging buffer is gone.
    backend.staging.destroy();
    let error = backend.steps(&[request(&scene, 2)]).unwrap_err();
    assert!(matches!(error, Error::Device(_)), "{error}");
    let got = backend.read_back().unwrap();
    // Whether the driver took the submission or not: the clock fits the parameters.
    assert!(got.1.step == 1 || got == expected, "step {}", got.1.step);
    assert_eq!(got.0 == expected.0, got.1.step == 2);
}

#[test]
fn a_batch_that_fails_half_way_leaves_the_steps_before_whole() {
    let Some(mut backend) = backend() else { return };
    let scene = scene();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    backend.step(&request(&scene, 1)).unwrap();
    let expected = backend.read_back().unwrap();
    // A photo of the wrong size, and an image that no device can hold.
    let small = TargetImage { width_px: 1, height_px: 1, rgb: vec![0; 3], mask: None };
    let bad = StepRequest { target: &small, ..request(&scene, 3) };
    assert!(backend.steps(&[request(&scene, 2), bad]).is_err());
    assert!(backend.read_back().unwrap() == expected);
    let huge = scene.camera.resized(60_000, 60_000);
    let error = backend.render(&huge, &RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false });
    assert!(matches!(error, Err(Error::Device(_))));
    assert!(backend.read_back().unwrap() == expected);
    backend.step(&request(&scene, 2)).unwrap();
    assert_eq!(backend.read_back().unwrap().1.step, 2, "a refused size is not the end");
}

#[test]
fn before_the_first_upload_there_is_an_error_and_no_panic() {
    let Some(mut backend) = backend() else { return };
    let scene = scene();
    let options = RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false };
    let errors = [
        backend.step(&request(&scene, 1)).err(),
        backend.render(&scene.camera, &options).err(),
        backend.read_back().err(),
        backend.read_flushed().err(),
        backend.read_statistics().err(),
        backend.apply_plan(&crate::backend::DensityPlan::default()).err(),
    ];
    assert!(errors.iter().all(|e| matches!(e, Some(Error::Usage(_)))), "{errors:?}");
}

#[test]
fn an_upload_gives_back_what_the_model_before_needed() {
    let Some(mut backend) = backend() else { return };
    let large = random_scene(&SceneOptions { num_splats: 4_000, ..SceneOptions::default() });
    let small = scene();
    let bytes = |b: &GpuBackend| {
        let named = [Buf::Pairs, Buf::Partials, Buf::Pixels, Buf::SsimMaps, Buf::Photo];
        named.map(|name| b.resources.buffer(name).size())
    };
    let mut seen = Vec::new();
    for scene in [&large, &small, &large] {
        backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        backend.step(&request(scene, 1)).unwrap();
        seen.push(bytes(&backend));
    }
    assert!(seen[1].iter().zip(&seen[0]).all(|(small, large)| small < large), "{seen:?}");
    assert_eq!(seen[0], seen[2]);
    // An image that needs more pairs than any step does not enlarge the partial sums of steps.
    let before = backend.capacity.training_pairs;
    backend.capacity.pairs *= 2;
    backend.step(&request(&large, 2)).unwrap();
    assert_eq!((backend.capacity.training_pairs, bytes(&backend)[1]), (before, seen[0][1]));
}
