//! The wgpu backend against the f64 reference, within the minimum limits: what software drivers get, and what hardware without
//! subgroups gets, on every installed software driver; all else on the first.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::compare;
use common::gpu::{backend, backends, drivers, open};
use common::twin::{
    BACKGROUND, Observed, WEIGHTS, agree, observe, reference, scenes, texels_flush_at_the_rate_of_their_map,
};
use litetex_gs::backend::{Backend as _, LearningRates, LossWeights, RenderOptions, StepRequest};
use litetex_gs::gpu::{GpuBackend, GpuOptions, LimitChoice};
use litetex_gs::model::AdamState;
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};

/// Largest rms error of the texel gradients, over the rms of the reference.
const TEXEL_RMS: f64 = 2e-4; // needed 6.9e-5 on lavapipe and SwiftShader, with maps finer than pixels

const NO_GEOMETRY: LossWeights = LossWeights { distortion: 0.0, normal: 0.0, ..WEIGHTS };

#[test]
fn gpu_matches_the_reference_on_every_driver() {
    let mut backends: Vec<GpuBackend> = backends(GpuOptions::default()).collect();
    for options in scenes() {
        // Half as many splats as for the CPU backend, because of the slowest driver.
        let options = SceneOptions { num_splats: options.num_splats / 2, ..options };
        let scene = random_scene(&options);
        println!("{options:?}");
        let expected = reference(&scene, &NO_GEOMETRY);
        for backend in &mut backends {
            let got = observe(backend, &scene, &NO_GEOMETRY);
            assert!(
                agree(&scene, &got, &expected, TEXEL_RMS),
                "{:?}, seed {}",
                backend.device(),
                options.seed
            );
        }
    }
}

/// Options for a variant of the rasterisation, with pairs counted; that for hardware without clamps of indices.
fn variant(hardware: bool) -> GpuOptions {
    GpuOptions {
        hardware_kernels: Some(hardware),
        unchecked_indices: Some(hardware),
        count_pairs: true,
        ..GpuOptions::default()
    }
}

#[test]
fn the_kernels_for_hardware_match_the_reference() {
    // The scene with texels smaller than pixels, and an ordinary one.
    let cases = [3, 0].map(|at| {
        let scene = random_scene(&SceneOptions { num_splats: 600, ..scenes().swap_remove(at) });
        let expected = reference(&scene, &NO_GEOMETRY);
        (scene, expected)
    });
    for mut backend in backends(variant(true)) {
        let mut observed = |hardware: bool| {
            backend.set_options(variant(hardware)).unwrap();
            cases.each_ref().map(|(scene, _)| observe(&mut backend, scene, &NO_GEOMETRY))
        };
        let (hardware, software) = (observed(true), observed(false));
        for ((scene, expected), (hardware, software)) in cases.iter().zip(hardware.iter().zip(&software)) {
            assert!(agree(scene, hardware, expected, TEXEL_RMS));
            assert_eq!(hardware.image, software.image);
            assert!(
                hardware.splats != software.splats,
                "gradients of different variants differ in their last bits"
            );
        }
    }
}

/// Numbers of lanes that the backward pass can sum over by subgroups on this device: all, and half of them. Prints that
/// there are none, or fails where drivers are required.
fn sum_lanes(backend: &GpuBackend) -> Vec<u32> {
    let lanes = backend.gpu().subgroup_lanes();
    let out: Vec<u32> = [lanes, lanes / 2].into_iter().filter(|lanes| (4..=32).contains(lanes)).collect();
    println!("subgroups of {lanes} lanes, sums over {out:?}");
    let required = std::env::var_os("LITETEX_REQUIRE_GPU").is_some_and(|n| n != "0");
    assert!(!out.is_empty() || !required, "the driver has no subgroups of one size");
    out
}

#[test]
fn sums_by_subgroups_match_the_reference_and_repeat() {
    let cases = [3, 0].map(|at| {
        let scene = random_scene(&SceneOptions { num_splats: 600, ..scenes().swap_remove(at) });
        let expected = reference(&scene, &NO_GEOMETRY);
        (scene, expected)
    });
    if let Some(mut backend) = backend(variant(true)) {
        let mut others = vec![cases.each_ref().map(|(scene, _)| observe(&mut backend, scene, &NO_GEOMETRY))];
        for lanes in sum_lanes(&backend) {
            for hardware in [true, false] {
                backend.set_options(GpuOptions { sum_lanes: Some(lanes), ..variant(hardware) }).unwrap();
                let got = cases.each_ref().map(|(scene, _)| observe(&mut backend, scene, &NO_GEOMETRY));
                for (at, (scene, expected)) in cases.iter().enumerate() {
                    println!("{lanes} lanes, hardware: {hardware}");
                    assert!(agree(scene, &got[at], expected, TEXEL_RMS));
                    assert_eq!(got[at].image, others[0][at].image);
                    let differ = others.iter().all(|other| got[at].splats != other[at].splats);
                    assert!(differ, "sums of different order differ in their last bits");
                }
                assert!(observe(&mut backend, &cases[0].0, &NO_GEOMETRY) == got[0], "the bytes repeat");
                others.push(got);
            }
        }
        let mut moved = random_scene(&SceneOptions { num_splats: 600, ..scenes().swap_remove(3) });
        moved.model.splats.opacity_logits.iter_mut().for_each(|logit| *logit += 0.01);
        let got = observe(&mut backend, &moved, &NO_GEOMETRY);
        assert!(!agree(&cases[0].0, &got, &cases[0].1, TEXEL_RMS));
    }
}

/// Scenes with tiles of hundreds of pairs: translucent, so that pixels blend pairs of all segments, and opaque, so that they end in
/// an earlier one, in many tiles all of them.
fn long_tiles() -> [RandomScene; 2] {
    [(0.006, 0.03), (0.05, 0.4)].map(|opacities| {
        random_scene(&SceneOptions {
            num_splats: 1_200,
            width_px: 72,
            height_px: 50,
            scales: (0.1, 0.4),
            opacities,
            seed: 6,
            ..SceneOptions::default()
        })
    })
}

/// Options for sums by subgroups, with segments of this number of pairs; `None`: the default.
fn in_segments(lanes: u32, segment_pairs: Option<u32>) -> GpuOptions {
    GpuOptions { sum_lanes: Some(lanes), segment_pairs, ..variant(true) }
}

#[test]
fn segments_of_tiles_match_the_reference_and_repeat() {
    let cases = long_tiles().map(|scene| {
        let expected = reference(&scene, &NO_GEOMETRY);
        (scene, expected)
    });
    let both = |backend: &mut GpuBackend, options: GpuOptions, order: [usize; 2]| {
        backend.set_options(options).unwrap();
        order.map(|at| observe(backend, &cases[at].0, &NO_GEOMETRY))
    };
    if let Some(mut backend) = backend(variant(true)) {
        let Some(lanes) = sum_lanes(&backend).first().copied() else { return };
        let whole = both(&mut backend, in_segments(lanes, Some(0)), [0, 1]);
        let num_ended = whole.each_ref().map(|o| o.image.alpha.iter().filter(|a| **a > 0.999).count());
        println!("{num_ended:?} of {} pixels end before the last pair", whole[0].image.alpha.len());
        assert!(num_ended[0] == 0 && num_ended[1] * 2 > whole[1].image.alpha.len());
        for segment_pairs in [64, 128] {
            let options = in_segments(lanes, Some(segment_pairs));
            for options in [options, GpuOptions { hardware_kernels: Some(false), ..options }] {
                let got = both(&mut backend, options, [0, 1]);
                for (at, (scene, expected)) in cases.iter().enumerate() {
                    println!("{options:?}");
                    assert!(agree(scene, &got[at], expected, TEXEL_RMS));
                    assert_eq!(got[at].image, whole[at].image);
                    assert!(got[at].splats != whole[at].splats, "they differ in their last bits");
                }
                // In the other order, so that each scene finds the states of the other one.
                let again = both(&mut backend, options, [1, 0]);
                assert!(again[1] == got[0] && again[0] == got[1], "the bytes repeat");
            }
        }
    }
}

#[test]
fn tiles_of_one_segment_are_the_same_bytes_as_whole_ones() {
    let short = random_scene(&SceneOptions { num_splats: 250, ..scenes().swap_remove(0) });
    if let Some(mut backend) = backend(variant(true)) {
        let Some(lanes) = sum_lanes(&backend).first().copied() else { return };
        let mut observed = |scene: &RandomScene, segment_pairs: Option<u32>| {
            backend.set_options(in_segments(lanes, segment_pairs)).unwrap();
            observe(&mut backend, scene, &NO_GEOMETRY)
        };
        // No tile has more pairs than the scene has splats.
        assert!(observed(&short, None) == observed(&short, Some(0)));
        let [long, _] = long_tiles();
        assert!(observed(&long, None) != observed(&long, Some(0)), "negative control: longer tiles");
    }
}

/// Buffers that hold the partial sums of 1,500 pairs, of 20 floats each.
const SMALL: LimitChoice = LimitChoice::Buffers(120_000);

#[test]
fn sums_by_subgroups_and_segments_in_several_turns_are_the_same_bytes() {
    let options = SceneOptions {
        num_splats: 400,
        width_px: 64,
        height_px: 40,
        scales: (0.1, 0.5),
        opacities: (0.02, 0.2),
        map_sizes: vec![(4, 4)],
        ..SceneOptions::default()
    };
    let scene = random_scene(&options);
    let Some(choice) = drivers().into_iter().next() else { return };
    let [plenty, small] = [LimitChoice::Downlevel, SMALL].map(|limits| {
        let mut backend = open(&choice, limits, variant(true));
        let lanes = sum_lanes(&backend).pop();
        [128, 0].map(|segment_pairs| {
            let segment_pairs = Some(segment_pairs);
            backend.set_options(GpuOptions { sum_lanes: lanes, segment_pairs, ..variant(true) }).unwrap();
            observe(&mut backend, &scene, &NO_GEOMETRY)
        })
    });
    assert!(small == plenty);
    let [segments, plenty] = plenty;
    assert!(segments != plenty, "negative control: whole tiles");
    let mut without = open(&choice, SMALL, GpuOptions { sum_lanes: Some(0), ..variant(true) });
    let other = observe(&mut without, &scene, &NO_GEOMETRY);
    assert!(other != plenty, "negative control: the other kernel");
    let step = without.step(&StepRequest {
        step: 2,
        camera: scene.camera,
        photo: None,
        target: &scene.target,
        background: BACKGROUND,
        sh_degree: scene.model.splats.sh_degree(),
        loss: NO_GEOMETRY,
        rates: LearningRates::default(),
        accumulate_statistics: true,
        exposure: None,
    });
    assert!(step.unwrap().counters.tile_pairs > 1_500, "several turns");
}

#[test]
fn a_small_change_of_the_scene_is_detected() {
    if let Some(mut backend) = backend(GpuOptions::default()) {
        let mut scene = random_scene(&SceneOptions { num_splats: 500, ..SceneOptions::default() });
        let expected = reference(&scene, &NO_GEOMETRY);
        for logit in &mut scene.model.splats.opacity_logits {
            *logit += 0.01;
        }
        let got = observe(&mut backend, &scene, &NO_GEOMETRY);
        assert!(!agree(&scene, &got, &expected, TEXEL_RMS));
    }
}

/// An opaque scene, whose pixels have surface normals, and a scene near the camera, whose photo has a mask.
fn surfaces() -> [RandomScene; 2] {
    let mut scenes = [(scenes().swap_remove(1), 700), (scenes().swap_remove(4), 200)]
        .map(|(options, num_splats)| random_scene(&SceneOptions { num_splats, ..options }));
    let num_pixels = scenes[1].camera.pinhole.num_pixels();
    scenes[1].target.mask = Some((0..num_pixels).map(|i| u8::from(i % 7 != 0)).collect());
    scenes
}

#[test]
fn terms_on_depths_and_normals_match_the_reference() {
    terms_match(backends(variant(false)), &LossWeights { distortion: 0.0, ..WEIGHTS });
}

#[test]
fn terms_on_depths_and_normals_match_the_reference_with_the_kernels_for_hardware() {
    terms_match(backends(variant(true)).take(1), &LossWeights { normal: 0.0, ..WEIGHTS });
}

#[test]
fn terms_on_depths_and_normals_match_the_reference_with_sums_by_subgroups() {
    let by_subgroups = backend(variant(true)).map(|mut backend| {
        let options = GpuOptions { sum_lanes: sum_lanes(&backend).pop(), ..variant(true) };
        backend.set_options(options).unwrap();
        backend
    });
    terms_match(by_subgroups.into_iter(), &LossWeights { normal: 0.0, ..WEIGHTS });
}

/// Compares on these backends; the negative control on the first is a step with the weights `without`, which omit
/// a term.
fn terms_match(backends: impl Iterator<Item = GpuBackend>, without: &LossWeights) {
    let cases = surfaces().map(|scene| {
        let expected = reference(&scene, &WEIGHTS);
        assert!(expected.loss.distortion > 0.0 && expected.loss.normal > 0.0);
        (scene, expected)
    });
    for (at, mut backend) in backends.enumerate() {
        for (scene, expected) in &cases {
            let got = observe(&mut backend, scene, &WEIGHTS);
            assert!(agree(scene, &got, expected, TEXEL_RMS));
            if at == 0 {
                let other = Observed { loss: got.loss, ..observe(&mut backend, scene, without) };
                assert!(!agree(scene, &other, expected, TEXEL_RMS));
            }
        }
    }
}

/// Whether depths and normals of an image agree with the reference, with all splats moved by `moved`: needed
/// 4.3e-5 of the largest, for all pixels.
fn images_agree(backend: &mut GpuBackend, scene: &RandomScene, moved: f32) -> bool {
    let expected = reference(scene, &NO_GEOMETRY).image;
    let mut model = scene.model.clone();
    model.splats.positions.chunks_exact_mut(3).for_each(|p| p[2] += moved);
    backend.upload(&model, &AdamState::zeros(&model)).unwrap();
    let sh_degree = model.splats.sh_degree();
    let options = RenderOptions { background: BACKGROUND, sh_degree, geometry: true };
    let image = backend.render(&scene.camera, &options).unwrap();
    let plain = backend.render(&scene.camera, &RenderOptions { geometry: false, ..options }).unwrap();
    assert!(plain.depth.is_empty() && plain.normal.is_empty());
    let colours: Vec<f64> = plain.rgb.iter().map(|&v| v.into()).collect();
    assert_eq!(compare(&image.rgb, &colours, 1e-6).beyond, 0);
    let normal: Vec<f64> = expected.normal.iter().flat_map(|n| n.to_array()).collect();
    [(&image.depth, &expected.depth), (&image.normal, &normal)].into_iter().all(|(got, expected)| {
        let d = compare(got, expected, 1e-4);
        println!("{d:?}");
        d.beyond * 1000 <= d.entries && d.non_zero * 4 > d.entries
    })
}

#[test]
fn rendered_depths_and_normals_match_the_reference() {
    for mut backend in backends(GpuOptions::default()) {
        for scene in surfaces() {
            assert!(images_agree(&mut backend, &scene, 0.0));
            assert!(!images_agree(&mut backend, &scene, 1e-3));
        }
    }
}

#[test]
fn a_step_does_not_depend_on_the_loss_terms_of_the_step_before() {
    if let Some(mut backend) = backend(GpuOptions::default()) {
        let scene = random_scene(&SceneOptions { num_splats: 300, ..SceneOptions::default() });
        let fresh = observe(&mut backend, &scene, &NO_GEOMETRY);
        let weights = [WEIGHTS, NO_GEOMETRY];
        backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        // With learning rates of zero, in one submission: only the moments change.
        let request = |k: usize| StepRequest {
            step: k as u32 + 1,
            camera: scene.camera,
            photo: None,
            target: &scene.target,
            background: BACKGROUND,
            sh_degree: scene.model.splats.sh_degree(),
            loss: weights[k],
            rates: LearningRates::default(),
            accumulate_statistics: true,
            exposure: None,
        };
        let reports = backend.steps(&[request(0), request(1)]).unwrap();
        assert!(reports[0].loss.distortion > 0.0 && reports[0].loss.normal >= 0.0);
        assert_eq!(reports[1].loss, fresh.loss);
        let after = observe(&mut backend, &scene, &NO_GEOMETRY);
        assert_eq!(after, fresh);
    }
}

#[test]
fn pending_texels_are_flushed_at_their_maps_rate() {
    for mut backend in backends(GpuOptions::default()) {
        assert!(texels_flush_at_the_rate_of_their_map(&mut backend), "{:?}", backend.device());
    }
}
