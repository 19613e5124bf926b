//! A model of the same sizes takes the place of the one before; its buffers stay.

use super::device::LimitChoice;
use super::fault_tests::request;
use super::form::GpuOptions;
use super::harness::test_drivers;
use super::kernels::Buf;
use super::state::GpuBackend;
use crate::backend::Backend as _;
use crate::model::AdamState;
use crate::selftest::{RandomScene, SceneOptions, random_scene};

fn scene(seed: u64, num_splats: usize) -> RandomScene {
    random_scene(&SceneOptions { num_splats, seed, ..SceneOptions::default() })
}

#[test]
fn buffers_of_the_same_sizes_stay() {
    let open = || {
        let choice = test_drivers().into_iter().next()?;
        let device = super::device::GpuDevice::open(&choice, LimitChoice::Downlevel).unwrap();
        Some(GpuBackend::new(device, GpuOptions::default()).unwrap())
    };
    let (Some(mut used), Some(mut fresh)) = (open(), open()) else { return };
    let (first, larger) = (scene(1, 300), scene(1, 301));
    let mut second = first.model.clone();
    second.splats.positions.iter_mut().for_each(|p| *p *= 1.1);
    second.textures.texels.iter_mut().for_each(|t| *t += 0.25);
    let mut adam = AdamState::zeros(&second);
    adam.splats_v.positions.fill(1e-6);

    used.upload(&first.model, &AdamState::zeros(&first.model)).unwrap();
    used.steps(&[1, 2].map(|step| request(&first, step))).unwrap();
    let buffer = |backend: &GpuBackend| backend.resources.buffer(Buf::SplatP).clone();
    let before = buffer(&used);
    for backend in [&mut used, &mut fresh] {
        backend.upload(&second, &adam).unwrap();
        assert!(backend.read_back().unwrap() == (second.clone(), adam.clone()));
        assert_eq!(backend.read_statistics().unwrap().views, 0);
    }
    assert!(buffer(&used) == before);
    let reports = [&mut used, &mut fresh].map(|backend| backend.steps(&[request(&first, 1)]).unwrap());
    assert!(reports[0] == reports[1]);
    assert!(used.read_back().unwrap() == fresh.read_back().unwrap());
    assert!(used.read_statistics().unwrap() == fresh.read_statistics().unwrap());
    // Negative control: another number of splats.
    used.upload(&larger.model, &AdamState::zeros(&larger.model)).unwrap();
    assert!(buffer(&used) != before);
}
