//! State of the backend after steps that failed on a live device, and errors of calls before the first upload.

use super::device::{GpuDevice, LimitChoice};
use super::form::GpuOptions;
use super::harness::test_drivers;
use super::kernels::Buf;
use super::state::GpuBackend;
use crate::Error;
use crate::backend::{Backend as _, LearningRates, LossWeights, RenderOptions, StepRequest, TargetImage};
use crate::model::AdamState;
use crate::selftest::{RandomScene, SceneOptions, random_scene};

/// A backend on the first of [`test_drivers`].
pub(super) fn backend() -> Option<GpuBackend> {
    let choice = test_drivers().into_iter().next()?;
    let device = GpuDevice::open(&choice, LimitChoice::Downlevel).unwrap();
    Some(GpuBackend::new(device, GpuOptions::default()).unwrap())
}

fn scene() -> RandomScene {
    let options = SceneOptions { num_splats: 100, width_px: 48, height_px: 40, ..SceneOptions::default() };
    random_scene(&options)
}

pub(super) fn request(scene: &RandomScene, step: u32) -> StepRequest<'_> {
    StepRequest {
        step,
        camera: scene.camera,
        photo: None,
        target: &scene.target,
        background: [0.0; 3],
        sh_degree: 3,
        loss: LossWeights::PUBLISHED,
        rates: LearningRates { position: 1e-3, texel: 1e-2, ..LearningRates::default() },
        accumulate_statistics: true,
        exposure: None,
    }
}

/// Causes an uncaptured error, by a request that every driver rejects.
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
fn after_a_refused_command_the_state_can_be_read_but_not_advanced() {
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
    assert!(backend.read_back().unwrap() == expected, "failed calls change nothing");
    assert_eq!(backend.read_statistics().unwrap(), statistics, "checkpoints include the statistics");
    // Negative control: a lost device cannot be read.
    backend.lose_device();
    assert!(matches!(backend.read_back(), Err(Error::Device(_))));
}

#[test]
fn applied_steps_count_even_if_their_status_was_not_read() {
    let Some(mut backend) = backend() else { return };
    let scene = scene();
    let adam = AdamState::zeros(&scene.model);
    backend.upload(&scene.model, &adam).unwrap();
    backend.steps(&[request(&scene, 1), request(&scene, 2)]).unwrap();
    let expected = backend.read_back().unwrap();
    backend.upload(&scene.model, &adam).unwrap();
    backend.steps(&[request(&scene, 1)]).unwrap();
    // Destroys the staging buffer, so that the status of the second step cannot be read.
    backend.staging[0].destroy();
    let error = backend.steps(&[request(&scene, 2)]).unwrap_err();
    assert!(matches!(error, Error::Device(_)), "{error}");
    let got = backend.read_back().unwrap();
    // Whether or not the driver executed the submission, the clock matches the parameters.
    assert!(got.1.step == 1 || got == expected, "step {}", got.1.step);
    assert_eq!(got.0 == expected.0, got.1.step == 2);
}

#[test]
fn a_failing_batch_leaves_earlier_steps_intact() {
    let Some(mut backend) = backend() else { return };
    let scene = scene();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    backend.step(&request(&scene, 1)).unwrap();
    let expected = backend.read_back().unwrap();
    // A photo of the wrong size, then an image that no device can hold.
    let small = TargetImage::opaque(1, 1, vec![0; 3]);
    let bad = StepRequest { target: &small, ..request(&scene, 3) };
    assert!(backend.steps(&[request(&scene, 2), bad]).is_err());
    assert!(backend.read_back().unwrap() == expected);
    let huge = scene.camera.resized(60_000, 60_000);
    let error = backend.render(&huge, &RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false });
    assert!(matches!(error, Err(Error::DeviceFull(_))));
    assert!(backend.read_back().unwrap() == expected);
    backend.step(&request(&scene, 2)).unwrap();
    assert_eq!(backend.read_back().unwrap().1.step, 2, "training continues after a refused size");
}

#[test]
fn calls_before_the_first_upload_are_errors_not_panics() {
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
fn buffers_of_images_and_pairs_keep_their_size_over_uploads() {
    let Some(mut backend) = backend() else { return };
    let large = random_scene(&SceneOptions { num_splats: 4_000, ..SceneOptions::default() });
    let small = scene();
    let bytes = |b: &GpuBackend| {
        let named = [Buf::Pairs, Buf::Partials, Buf::Pixels, Buf::SsimMaps];
        named.map(|name| b.resources.buffer(name).size())
    };
    let mut seen = Vec::new();
    for scene in [&small, &large, &small] {
        backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        backend.step(&request(scene, 1)).unwrap();
        seen.push(bytes(&backend));
    }
    assert!(seen[0].iter().zip(&seen[1]).all(|(small, large)| small < large), "{seen:?}");
    assert_eq!(seen[1], seen[2]);
    // Images that need more pairs than any step do not enlarge the partial sums.
    let before = backend.capacity.training_pairs;
    backend.capacity.pairs *= 2;
    backend.step(&request(&small, 2)).unwrap();
    assert_eq!((backend.capacity.training_pairs, bytes(&backend)[1]), (before, seen[1][1]));
}
