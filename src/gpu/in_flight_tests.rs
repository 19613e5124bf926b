//! Two submissions in flight: the same bytes as one at a time, also where pairs do not fit, commands are refused or the device
//! has no room.

use super::device::{GpuDevice, LimitChoice};
use super::fault_tests::request;
use super::form::GpuOptions;
use super::harness::test_drivers;
use super::state::GpuBackend;
use crate::Error;
use crate::backend::{Backend as _, StepReport, StepRequest, TargetImage, WindowStatistics};
use crate::camera::Camera;
use crate::model::{AdamState, Model};
use crate::selftest::{RandomScene, SceneOptions, random_scene};

/// Steps of a submission.
const BATCH: usize = 3;
const STEPS: u32 = 13;

fn options() -> GpuOptions {
    GpuOptions { batch_steps: Some(BATCH), ..GpuOptions::default() }
}

fn open(limits: LimitChoice, options: GpuOptions) -> Option<GpuBackend> {
    let choice = test_drivers().into_iter().next()?;
    Some(GpuBackend::new(GpuDevice::open(&choice, limits).unwrap(), options).unwrap())
}

/// A scene, cameras that see some splats and all, and photos.
struct Inputs {
    scene: RandomScene,
    cameras: [Camera; 2],
    photos: [TargetImage; 2],
}

impl Inputs {
    fn new() -> Self {
        let options =
            SceneOptions { num_splats: 300, width_px: 48, height_px: 40, ..SceneOptions::default() };
        let scene = random_scene(&options);
        let mut aside = scene.camera;
        aside.pinhole.cx_px += 30.0;
        let mut inverted = scene.target.clone();
        inverted.rgb.iter_mut().for_each(|value| *value = 255 - *value);
        Self { cameras: [aside, scene.camera], photos: [scene.target.clone(), inverted], scene }
    }

    /// Steps that see all splats from step `all_from` on, and another photo in every other step: each is sent again, to places
    /// that the submission before uses.
    fn requests(&self, all_from: u32) -> Vec<StepRequest<'_>> {
        let request = |step: u32| StepRequest {
            camera: self.cameras[usize::from(step >= all_from)],
            target: &self.photos[step as usize % 2],
            ..request(&self.scene, step)
        };
        (1..=STEPS).map(request).collect()
    }

    fn upload(&self, backend: &mut GpuBackend) {
        backend.upload(&self.scene.model, &AdamState::zeros(&self.scene.model)).unwrap();
    }
}

type Trained = (Model, AdamState, WindowStatistics);

fn state(backend: &mut GpuBackend) -> Trained {
    let (model, adam) = backend.read_back().unwrap();
    (model, adam, backend.read_statistics().unwrap())
}

/// State and reports after these steps, `per_call` at a time; and the number of submissions made while another was under way.
fn trained(
    backend: &mut GpuBackend,
    inputs: &Inputs,
    requests: &[StepRequest<'_>],
    per_call: usize,
) -> (Trained, Vec<StepReport>, u64) {
    inputs.upload(backend);
    let before = backend.device.work().overlapping;
    let calls = requests.chunks(per_call).flat_map(|call| backend.steps(call).unwrap());
    let reports: Vec<StepReport> = calls.collect();
    let overlapping = backend.device.work().overlapping - before;
    (state(backend), reports, overlapping)
}

#[test]
fn two_submissions_in_flight_change_no_bit() {
    let Some(mut backend) = open(LimitChoice::Downlevel, options()) else { return };
    let inputs = Inputs::new();
    // Where pairs do not fit: in the middle of the first submission, at the start, in the middle and at the end of the one
    // behind it, and later.
    for all_from in [2, 4, 5, 6, 11] {
        let requests = inputs.requests(all_from);
        let (one, reports, overlapping) = trained(&mut backend, &inputs, &requests, BATCH);
        assert_eq!(overlapping, 0, "one at a time");
        let pairs: Vec<u64> = reports.iter().map(|report| report.counters.tile_pairs).collect();
        let (few, more) = pairs.split_at(all_from as usize - 1);
        let capacity = few.iter().copied().max();
        assert!(capacity.unwrap() < more[0] && reports.len() == STEPS as usize, "{pairs:?}");

        let (two, same, overlapping) = trained(&mut backend, &inputs, &requests, requests.len());
        assert!(two == one && same == reports, "all from {all_from}");
        assert_eq!(overlapping, 4, "five submissions");
        let less = &requests[..requests.len() - 1];
        assert!(trained(&mut backend, &inputs, less, less.len()).0 != one, "negative control: a step less");

        let mut small =
            open(LimitChoice::Downlevel, GpuOptions { pair_capacity: capacity, ..options() }).unwrap();
        let (repeated, same, overlapping) = trained(&mut small, &inputs, &requests, requests.len());
        assert!(small.capacity.training_pairs > capacity.unwrap(), "all pairs fit");
        assert!(repeated == one && same == reports && overlapping >= 4, "repeated from {all_from}");
    }
}

#[test]
fn the_timer_sees_one_submission_at_a_time() {
    let Some(mut backend) = open(LimitChoice::Downlevel, options()) else { return };
    let inputs = Inputs::new();
    let requests = inputs.requests(1);
    let expected = trained(&mut backend, &inputs, &requests, requests.len()).0;
    backend.set_options(GpuOptions { time_kernels: true, ..options() }).unwrap();
    let (timed, reports, overlapping) = trained(&mut backend, &inputs, &requests, requests.len());
    assert!(timed == expected);
    if backend.timer.is_some() {
        assert!(overlapping == 0 && reports.iter().all(|report| !report.stages.is_empty()));
    }
}

#[test]
fn after_a_refused_submission_the_one_before_counts() {
    let Some(mut backend) = open(LimitChoice::Downlevel, options()) else { return };
    let inputs = Inputs::new();
    let requests = inputs.requests(1);
    let [less, expected] =
        [BATCH - 1, BATCH].map(|steps| trained(&mut backend, &inputs, &requests[..steps], steps).0);
    inputs.upload(&mut backend);
    // The copy of the second submission's statuses is refused, and with it the submission.
    backend.staging[1].destroy();
    let error = backend.steps(&requests).unwrap_err();
    assert!(matches!(error, Error::Device(_)), "{error}");
    let got = state(&mut backend);
    assert_eq!((got.1.step, got.2.views), (BATCH as u32, BATCH as u32));
    assert!(got == expected && got != less);
    assert!(state(&mut backend) == expected, "counted once");
}

/// Buffers for the texels of the scene, and for 6,666 pixels of 36 bytes.
const SMALL: LimitChoice = LimitChoice::Buffers(240_000);

#[test]
fn without_room_for_the_next_submission_the_one_under_way_counts() {
    let Some(mut backend) = open(SMALL, options()) else { return };
    let inputs = Inputs::new();
    let (width_px, height_px) = (100, 70);
    let large = TargetImage::opaque(width_px, height_px, vec![0; 3 * (width_px * height_px) as usize]);
    let mut requests = inputs.requests(1);
    let expected = trained(&mut backend, &inputs, &requests[..BATCH], BATCH).0;
    let all = trained(&mut backend, &inputs, &requests, requests.len()).0;
    assert!(all != expected, "negative control");
    let camera = requests[BATCH + 1].camera.resized(width_px, height_px);
    requests[BATCH + 1] = StepRequest { camera, target: &large, ..request(&inputs.scene, 5) };
    inputs.upload(&mut backend);
    assert_eq!(backend.steps(&requests).unwrap().len(), BATCH);
    let error = backend.steps(&requests[BATCH..]).unwrap_err();
    assert!(matches!(error, Error::DeviceFull(_)), "{error}");
    assert!(state(&mut backend) == expected);
    backend.steps(&inputs.requests(1)[BATCH..]).unwrap();
    assert!(state(&mut backend) == all, "goes on as if nothing had happened");
}

#[test]
fn steps_before_one_with_too_many_pairs_count() {
    let Some(mut backend) = open(LimitChoice::Downlevel, options()) else { return };
    let inputs = Inputs::new();
    // In the first submission, at the start and in the middle of the one behind it.
    for all_from in [3, 4, 5] {
        let requests = inputs.requests(all_from);
        let fitting = all_from as usize - 1;
        let (expected, reports, _) = trained(&mut backend, &inputs, &requests[..fitting], BATCH);
        let most_pairs = reports.iter().map(|report| report.counters.tile_pairs).max();
        let options = GpuOptions { most_pairs, ..options() };
        let mut small = open(LimitChoice::Downlevel, options).unwrap();
        inputs.upload(&mut small);
        assert!(small.steps(&requests).unwrap() == reports, "all from {all_from}");
        let error = small.steps(&requests[fitting..]).unwrap_err();
        assert!(matches!(error, Error::DeviceFull(_)), "{error}");
        assert!(state(&mut small) == expected);
    }
}
