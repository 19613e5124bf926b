//! Predictions of offers, against what their plans do to the image.

use super::accept::{Excess, accept, planned, threshold_for};
use super::offers::{Accepted, Offers, Thresholds};
use super::round::trial_steps;
use crate::backend::{BETWEEN, Backend as _, ColourMap, Costs, MapChange, Probe, RenderOptions, probed};
use crate::cpu::CpuBackend;
use crate::model::{AdamState, Model, TextureMap};
use crate::selftest::{RandomScene, SceneOptions, random_scene};
use crate::train::charge::Charge;
use crate::train::density::cropped_map;

const PROBES: u32 = 300;

/// A scene whose splats have this coefficient of SH degree 0 in all channels.
fn scene(dc: f32) -> RandomScene {
    let mut scene = random_scene(&SceneOptions {
        num_splats: 40,
        map_sizes: vec![(4, 4), (8, 6), (2, 5), (1, 1), (0, 0)],
        width_px: 64,
        height_px: 48,
        scales: (0.05, 0.2),
        opacities: (0.3, 0.9),
        depths: (0.8, 2.0),
        ..SceneOptions::default()
    });
    // Colours that the clamp at 0 leaves alone, so that the image is linear in SH coefficients and texels.
    for splat in 0..scene.model.num_splats() {
        scene.model.splats.sh_of_mut(splat)[..3].fill(dc);
    }
    scene.model = probed(scene.model);
    scene
}

fn render(backend: &mut CpuBackend, scene: &RandomScene) -> Vec<f32> {
    let options = RenderOptions { background: [0.2; 3], sh_degree: 3, geometry: false };
    backend.render(&scene.camera, &options).expect("an image").rgb
}

/// The offers of a scene's model, after all probes through this exposure.
fn probed_offers<'a>(scene: &'a RandomScene, backend: &mut CpuBackend, exposure: &ColourMap) -> Offers<'a> {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).expect("room");
    let probe = |seed| Probe::new(scene.camera, &scene.target, [0.2; 3], 3, seed);
    let mut probes = (0..PROBES).map(|seed| Ok(Probe { exposure: *exposure, ..probe(seed.into()) }));
    let costs = backend.probe(&mut probes).expect("costs");
    Offers::new(&scene.model, (costs, PROBES), false, false)
}

/// Parameters saved and mean squared change of the image if these offers are taken; and what is predicted.
fn measured(scene: &RandomScene, accepted: &[Option<Accepted>]) -> (usize, f64, f64) {
    let mut backend = CpuBackend::new(Some(2)).expect("a backend");
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).expect("room");
    let before = render(&mut backend, scene);
    let (outcome, plan) = planned(&scene.model, accepted);
    backend.apply_plan(&plan).expect("a plan that fits");
    let after: Model = backend.read_flushed().expect("a model");
    assert_eq!((after.num_params(), after.num_texels()), (outcome.params, outcome.texels));
    let squares = before.iter().zip(render(&mut backend, scene)).map(|(a, b)| f64::from(a - b).powi(2));
    let changed = squares.sum::<f64>() / before.len() as f64;
    (outcome.params_before - outcome.params, changed, accepted.iter().flatten().map(|offer| offer.cost).sum())
}

#[test]
fn images_change_as_predicted() {
    let scene = scene(1.5);
    let mut backend = CpuBackend::new(Some(2)).expect("a backend");
    let offers = probed_offers(&scene, &mut backend, &BETWEEN);
    let none = vec![false; 40];
    // Maps of a fixed size are not on offer; at this threshold all others go.
    let has_changed_map = |keeps_maps: bool| {
        let nothing = vec![Costs::default(); 40];
        let offers = Offers::new(&scene.model, (nothing, 1), false, keeps_maps);
        let accepted = accept(&offers, &none, &Thresholds::all(1.0));
        accepted.iter().flatten().any(|o| o.kept.is_some_and(|kept| kept.map != MapChange::Keep))
    };
    assert_eq!([true, false].map(has_changed_map), [false, true]);
    // Few enough that they hardly hide each other.
    let some: Vec<bool> = (0..40).map(|splat| splat % 8 == 0).collect();
    let mut saved = 0;
    // At higher thresholds, what bands and maps lose together no longer adds up.
    for threshold in [1e-9, 1e-8, 1e-7, 1e-6] {
        let (params, changed, predicted) =
            measured(&scene, &accept(&offers, &none, &Thresholds::all(threshold)));
        println!("threshold {threshold:e}: {params} parameters, {changed:.3e}, predicted {predicted:.3e}");
        assert!(params >= saved, "a higher threshold prunes more");
        saved = params;
        // Needed 0.85 to 1.06: squares of single probes vary by their own size, and offers that overlap add up.
        let ratio = predicted / changed;
        assert!((0.7..1.4).contains(&ratio), "{threshold:e}: {changed:e}, predicted {predicted:e}");
    }
    // At the threshold of a number of parameters, just as many are pruned.
    let threshold = threshold_for(&offers, &some, &Excess { params: 1_000, charge: 0.0 });
    let pruned: usize =
        accept(&offers, &some, &Thresholds::all(threshold)).iter().flatten().map(|offer| offer.params).sum();
    assert!((1_000..1_200).contains(&pruned), "{pruned}");
    // The same where the model is charged for bytes of its file.
    let by_bytes = offers.with_charge(Charge::BYTES);
    let saved = |threshold| -> f64 {
        accept(&by_bytes, &some, &Thresholds::all(threshold)).iter().flatten().map(|offer| offer.charge).sum()
    };
    let excess = Excess { params: 0, charge: 100.0 };
    let threshold_of_bytes = threshold_for(&by_bytes, &some, &excess);
    assert!((100.0..130.0).contains(&saved(threshold_of_bytes)), "{}", saved(threshold_of_bytes));
    assert!(saved(0.5 * threshold_of_bytes) < 100.0, "a lower threshold would have done");
    let offers = by_bytes.with_charge(Charge::PARAMS);
    // Negative control: offers that were predicted for other splats change the image more.
    let mut elsewhere = accept(&offers, &none, &Thresholds::all(1e-7));
    let predicted: f64 = elsewhere.iter().flatten().map(|offer| offer.cost).sum();
    elsewhere.rotate_left(5);
    for (splat, offer) in elsewhere.iter_mut().enumerate() {
        let has_map = scene.model.textures.maps[splat].rows > 0;
        if let Some(kept) = offer.as_mut().and_then(|offer| offer.kept.as_mut()) {
            kept.degree = kept.degree.min(scene.model.splats.sh_degrees()[splat]);
            kept.map = if has_map && kept.texels == 0 { kept.map } else { MapChange::Keep };
        }
    }
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).expect("room");
    let before = render(&mut backend, &scene);
    backend.apply_plan(&planned(&scene.model, &elsewhere).1).expect("a plan that fits");
    let after = render(&mut backend, &scene);
    let squares: f64 = before.iter().zip(after).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    assert!(squares / before.len() as f64 > 3.0 * predicted, "{squares}, predicted {predicted:e}");
}

#[test]
fn removal_costs_what_is_predicted_in_bright_scenes() {
    let scene = scene(4.0);
    let mut backend = CpuBackend::new(Some(2)).expect("a backend");
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).expect("room");
    let image = render(&mut backend, &scene);
    let bright = image.iter().filter(|&&value| value > 1.0).count() as f64 / image.len() as f64;
    assert!(bright > 0.2, "{bright}: the rest is background");
    assert!(image.iter().all(|value| (-1.5..2.5).contains(value)), "what a probe can tell");
    // Few enough that they hardly hide each other.
    let some: Vec<bool> = (0..40).map(|splat| splat % 8 == 0).collect();
    let mut ratio = |exposure: ColourMap| {
        let offers = probed_offers(&scene, &mut backend, &exposure);
        let (_, changed, predicted) =
            measured(&scene, &accept(&offers, &some, &Thresholds::all(1.0).only(0)));
        println!("removal: {changed:.3e}, predicted {predicted:.3e}");
        predicted / changed
    };
    let ratios = [BETWEEN, ColourMap::IDENTITY].map(&mut ratio);
    // Needed 1.005; squares of 300 probes vary by 8 %, and sums of five splats by less.
    assert!((0.8..1.25).contains(&ratios[0]), "{ratios:?}");
    // Negative control: the image itself is brighter than both photos, so that most signs are the same. Measured 30.
    assert!(ratios[1] > 10.0, "{ratios:?}");
}

/// The crop of as many rows and columns off the opposite sides, and the sides that this crop takes something off.
fn opposite(map: &TextureMap, mut crop: Accepted) -> Option<(Accepted, usize)> {
    let kept = crop.kept.as_mut()?;
    let MapChange::Regrid { rows, cols, first_row, first_col, .. } = kept.map else { return None };
    let last = [map.rows - rows, map.cols - cols].map(i32::from);
    let off = [[first_row, last[0] - first_row], [first_col, last[1] - first_col]];
    kept.map = cropped_map(map, off.map(|[first, last]| [last as usize, first as usize]));
    Some((crop, off.as_flattened().iter().filter(|&&texels| texels > 0).count()))
}

#[test]
fn crops_cost_what_is_predicted() {
    let scene = scene(1.5);
    let mut backend = CpuBackend::new(Some(2)).expect("a backend");
    let offers = probed_offers(&scene, &mut backend, &BETWEEN);
    let maps = &scene.model.textures.maps;
    for threshold in [1e-8, 1e-7, 1e-6, 1e-5] {
        let crop = |splat: usize| offers.crop(splat, threshold).filter(|_| maps[splat].rows > 0);
        let crops: Vec<Option<Accepted>> = (0..40).map(crop).collect();
        let (params, changed, predicted) = measured(&scene, &crops);
        let mirrored: Vec<_> = crops.iter().zip(maps).map(|(crop, map)| opposite(map, (*crop)?)).collect();
        let num_maps = mirrored.iter().flatten().count();
        let sides: usize = mirrored.iter().flatten().map(|m| m.1).sum();
        let mirrored: Vec<_> = mirrored.into_iter().map(|mirrored| mirrored.map(|m| m.0)).collect();
        let (_, control, _) = measured(&scene, &mirrored);
        println!("threshold {threshold:e}: {params} parameters off {sides} sides of {num_maps} maps");
        println!("    {changed:.3e}, predicted {predicted:.3e}, off opposite sides {control:.3e}");
        // Several sides of a map at once, so that their costs are added up.
        assert!(params > 0 && 3 * sides > 4 * num_maps, "{sides} sides of {num_maps} maps");
        // Needed 0.95 to 1.06.
        let ratio = predicted / changed;
        assert!((0.8..1.25).contains(&ratio), "{threshold:e}: {changed:e}, predicted {predicted:e}");
        // Negative control: 3.6 times as much at the highest threshold, 900 times at the lowest.
        assert!(control > 2.0 * changed, "{threshold:e}: {control:e}");
    }
}

#[test]
fn prices_weigh_fragments_beside_parameters() {
    let scene = scene(1.5);
    let charge = Charge::PARAMS.of_model(&scene.model);
    // All cost the same to remove, and those of even index cover the image.
    let costs = vec![Costs { seen: 1, removal: 1e-3, degrees: [1.0; 3], ..Costs::default() }; 40];
    let fragments: Vec<f64> = (0..40).map(|splat| f64::from(u8::from(splat % 2 == 0))).collect();
    let removed = |price: f64, fragments: Vec<f64>| {
        let offers =
            Offers::new(&scene.model, (costs.clone(), 1), false, true).with_fragments(price, fragments);
        let all = vec![true; 40];
        let removal = |threshold: f64| accept(&offers, &all, &Thresholds::all(threshold).only(0));
        let total: f64 = removal(1.0).iter().flatten().map(|offer| offer.price).sum();
        assert!((total / charge - 1.0).abs() < 1e-12, "{total}, not {charge}");
        let threshold = threshold_for(&offers, &all, &Excess { params: charge as usize / 4, charge: 0.0 });
        let removed = removal(threshold);
        let even = removed.iter().step_by(2).flatten().count();
        (even, removed.iter().flatten().count())
    };
    let (even, all) = removed(10.0, fragments.clone());
    assert!(even == all && all > 3, "{even} of {all}");
    // Negative controls: no price, fragments of all splats alike, and of none.
    let unpriced = removed(0.0, fragments);
    assert!(unpriced.0 < unpriced.1, "{unpriced:?}");
    assert_eq!([removed(10.0, vec![1.0; 40]), removed(10.0, vec![0.0; 40])], [unpriced; 2]);
}

#[test]
fn trials_of_merges_take_a_fiftieth_of_long_runs() {
    // 4 rounds of 3 trainings, and 2 of 3.
    assert_eq!([trial_steps(30_000, 4), trial_steps(6_000, 2)], [50, 20]);
    assert_eq!([trial_steps(1_000, 2), trial_steps(1_000_000, 0)], [8, 64]);
}
