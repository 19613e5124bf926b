//! Which workgroup of the backward pass visits which pairs, and what the states between segments are for. Comparisons with the
//! reference: tests/twin_gpu.rs.

use super::device::{GpuDevice, LimitChoice};
use super::fault_tests::request;
use super::form::GpuOptions;
use super::harness::test_drivers;
use super::kernels::Buf;
use super::layout::PAIR_SUMS;
use super::shader::GROUP;
use super::state::GpuBackend;
use super::uniform;
use crate::backend::{Backend as _, StepRequest};
use crate::model::{AdamState, SplatGroup};
use crate::selftest::{RandomScene, SceneOptions, random_scene};
use std::collections::BTreeSet;

/// Place of the faults in the sums of a pair (`shaders/common/pair_sums.wgsl`).
const SUM_FAULTS: usize = 16;

/// Tiles of at most 217 splats, so translucent that no pixel ends before the last.
fn scene() -> RandomScene {
    random_scene(&SceneOptions {
        num_splats: 600,
        width_px: 50,
        height_px: 40,
        scales: (0.1, 0.4),
        opacities: (0.006, 0.03),
        map_sizes: vec![(4, 4)],
        ..SceneOptions::default()
    })
}

/// On the first driver with subgroups of one size, if there is any.
fn by_subgroups(segment_pairs: u32) -> Option<GpuBackend> {
    for choice in test_drivers() {
        let device = GpuDevice::open(&choice, LimitChoice::Downlevel).unwrap();
        let lanes = device.subgroup_lanes();
        if (4..=32).contains(&lanes) {
            let options = GpuOptions {
                hardware_kernels: Some(true),
                sum_lanes: Some(lanes),
                segment_pairs: Some(segment_pairs),
                count_texel_atomics: true,
                ..GpuOptions::default()
            };
            return Some(GpuBackend::new(device, options).unwrap());
        }
    }
    println!("skipped: no driver has subgroups of one size");
    None
}

/// The first pair of each workgroup that visited any, which holds the count of its atomics, and the ranges of the tiles.
fn visited(backend: &mut GpuBackend, scene: &RandomScene) -> (BTreeSet<u32>, Vec<[u32; 2]>) {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    backend.step(&StepRequest { accumulate_statistics: false, ..request(scene, 1) }).unwrap();
    let [cols, rows] = uniform::grid(&scene.camera, backend.form.tile_rows_px);
    let ranges: Vec<[u32; 2]> =
        backend.device.read(backend.resources.buffer(Buf::TileRanges), (cols * rows) as usize).unwrap();
    let sums = PAIR_SUMS as usize;
    let count = sums * ranges.last().unwrap()[1] as usize;
    let partials: Vec<f32> = backend.device.read(backend.resources.buffer(Buf::Partials), count).unwrap();
    let counted = partials.chunks(sums).zip(0..).filter(|(pair, _)| pair[SUM_FAULTS] > 0.0);
    (counted.map(|(_, pair)| pair).collect(), ranges)
}

#[test]
fn no_workgroup_visits_more_pairs_than_a_segment_has() {
    let scene = scene();
    for pairs_each in [64, 128, 0] {
        let Some(mut backend) = by_subgroups(pairs_each) else { return };
        let (visited, ranges) = visited(&mut backend, &scene);
        let longest = ranges.iter().map(|[first, past]| past - first).max().unwrap();
        println!("segments of {pairs_each}: {} workgroups, tiles of at most {longest} pairs", visited.len());
        assert!(longest > 192);
        // Of the segments that have at least this number of pairs: splats may touch a tile, but no pixel.
        let firsts = |pairs_each: u32, least: u32| -> BTreeSet<u32> {
            let of_tile = |&[first, past]: &[u32; 2]| {
                let firsts = (first..past).step_by(pairs_each as usize);
                firsts.filter(move |first| past - first >= least)
            };
            ranges.iter().flat_map(of_tile).collect()
        };
        let each = if pairs_each > 0 { pairs_each } else { u32::MAX };
        assert!(visited.is_subset(&firsts(each, 1)) && visited.is_superset(&firsts(each, each)));
        assert_eq!(
            visited.is_superset(&firsts(64, 64)),
            pairs_each == 64,
            "negative control: longer segments"
        );
    }
}

/// The first moments of the splats after a step, with the states between segments changed after the forward pass.
fn moments(backend: &mut GpuBackend, scene: &RandomScene, change: impl Fn(&mut [f32])) -> Vec<f32> {
    let (request, photos) = (request(scene, 1), [(None, &scene.target)]);
    // Sizes all buffers.
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    backend.step(&request).unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let first_px = backend.photos.place(&backend.device, &backend.resources, &photos).unwrap()[0];
    backend.arm();
    let mut inputs = backend.uniform_inputs();
    inputs.pair_capacity = backend.capacity.training_pairs as u32;
    let turns = backend.turns(0, &uniform::step(&inputs, &request, first_px, 0));
    let dispatches = backend.step_dispatches(&turns, &scene.camera, false, true, false);
    let backward = dispatches.iter().position(|d| d.kernel == backend.raster.bwd_statistics).unwrap();
    backend.submit(&dispatches[..backward]);
    let buffer = backend.resources.buffer(Buf::Pairs).clone();
    let mut pairs: Vec<u32> = backend.device.read(&buffer, (buffer.size() / 4) as usize).unwrap();
    change(bytemuck::cast_slice_mut(&mut pairs[inputs.pair_capacity as usize..]));
    backend.device.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&pairs));
    backend.submit(&dispatches[backward..]);
    let moments = backend.read_back().unwrap().1.splats_m;
    SplatGroup::ALL.iter().flat_map(|&group| moments.group(group).to_vec()).collect()
}

/// Rms difference over the rms of the expected values.
fn off(got: &[f32], expected: &[f32]) -> f64 {
    let squares = |values: &mut dyn Iterator<Item = f32>| values.map(|v| f64::from(v).powi(2)).sum::<f64>();
    let differences = squares(&mut got.iter().zip(expected).map(|(a, b)| a - b));
    (differences / squares(&mut expected.iter().copied())).sqrt()
}

#[test]
fn segments_begin_with_the_states_at_their_boundaries() {
    let scene = scene();
    let Some(mut whole) = by_subgroups(0) else { return };
    let Some(mut backend) = by_subgroups(64) else { return };
    let expected = moments(&mut whole, &scene, |_| {});
    let mut off_by = |change: &dyn Fn(&mut [f32])| {
        let off = off(&moments(&mut backend, &scene, change), &expected);
        println!("{off:.1e}");
        off
    };
    let boundary = 4 * GROUP as usize;
    // Needed 2.3e-7 on lavapipe.
    assert!(off_by(&|_| {}) < 2e-6);
    // Negative controls: no colour behind, one boundary's states at the next, all light passes.
    let colours = |k: &usize| k % boundary < boundary * 3 / 4;
    let of = |states: &mut [f32], which: &dyn Fn(&usize) -> bool, value: f32| {
        (0..states.len()).filter(which).for_each(|k| states[k] = value);
    };
    assert!(off_by(&|states| of(states, &colours, 0.0)) > 1e-2);
    assert!(off_by(&|states| states.rotate_right(boundary)) > 1e-2);
    assert!(off_by(&|states| of(states, &|k| !colours(k), 1.0)) > 1e-2);
}
