//! Poisoned input must give a clean image and clean gradients on every backend. All cases run on the same backend, so
//! that none may affect later ones.

use litetex_gs::backend::{Backend, LearningRates, LossWeights, RenderOptions, StepRequest};
use litetex_gs::model::AdamState;
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};

pub const RATES: LearningRates = LearningRates {
    position: 1e-4,
    quaternion: 1e-3,
    log_scale: 5e-3,
    opacity: 0.05,
    sh_dc: 2.5e-3,
    sh_rest: 1e-4,
    texel: 1e-3,
    texel_growth: 0.5,
    texel_growth_limit: 4.0,
};

/// Renders and takes three steps: every pixel must be finite, and every finite parameter must stay finite.
/// Returns the sum of the image's alpha.
fn survives(backend: &mut dyn Backend, scene: &RandomScene, name: &str) -> f64 {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let options = RenderOptions { background: [0.1, 0.2, 0.3], sh_degree: 3, geometry: true };
    let image = backend.render(&scene.camera, &options).unwrap();
    let clean = |values: &[f32]| values.iter().all(|v| v.is_finite());
    assert!(
        clean(&image.rgb) && clean(&image.alpha) && clean(&image.depth) && clean(&image.normal),
        "{name}"
    );
    for step in 1..=3 {
        let report = backend
            .step(&StepRequest {
                step,
                camera: scene.camera,
                photo: None,
                target: &scene.target,
                background: options.background,
                sh_degree: scene.model.splats.sh_degree(),
                loss: LossWeights {
                    l1: 0.8,
                    dssim: 0.2,
                    mse: 0.0,
                    opacity: 0.01,
                    texture: 1e-8,
                    ..LossWeights::NONE
                },
                rates: RATES,
                accumulate_statistics: true,
                exposure: None,
            })
            .unwrap();
        assert!(report.loss.total.is_finite(), "{name}: {:?}", report.loss);
    }
    let after = backend.read_flushed().unwrap();
    let spread = |before: &[f32], after: &[f32]| {
        before.iter().zip(after).filter(|(b, a)| b.is_finite() && !a.is_finite()).count()
    };
    let (b, a) = (&scene.model, &after);
    for group in litetex_gs::model::SplatGroup::ALL {
        assert_eq!(spread(b.splats.group(group), a.splats.group(group)), 0, "{name}: {group:?}");
    }
    assert_eq!(spread(&b.textures.texels, &a.textures.texels), 0, "{name}: texels");
    image.alpha.iter().map(|&a| f64::from(a)).sum()
}

pub fn scene(seed: u64) -> RandomScene {
    random_scene(&SceneOptions {
        num_splats: 200,
        width_px: 61,
        height_px: 43,
        seed,
        ..SceneOptions::default()
    })
}

/// A third of the splats, or every seventh texel value, is poisoned.
pub fn poisoned_splats_do_not_affect_the_image_or_other_splats(backend: &mut dyn Backend) {
    assert!(survives(backend, &scene(1), "control") > 100.0);
    let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE / 2.0, 1e20, -1e20];
    for value in values {
        for group in litetex_gs::model::SplatGroup::ALL {
            let mut scene = scene(2);
            for i in (0..200).step_by(3) {
                let floats = scene.model.splats.range(group, i);
                scene.model.splats.group_mut(group)[floats.start + i % floats.len()] = value;
            }
            survives(backend, &scene, &format!("{group:?} = {value}"));
        }
        let mut scene = scene(3);
        scene.model.textures.texels.iter_mut().step_by(7).for_each(|t| *t = value);
        survives(backend, &scene, &format!("texels = {value}"));
    }
}

/// Zero quaternions, zero areas, the camera inside splats, no visible splat, no splat at all.
pub fn degenerate_splats_do_no_harm(backend: &mut dyn Backend) {
    let mut zero_quaternion = scene(4);
    zero_quaternion.model.splats.quaternions[..400].fill(0.0);
    survives(backend, &zero_quaternion, "zero quaternion");
    let mut zero_area = scene(5);
    zero_area.model.splats.log_scales[..200].fill(-200.0);
    survives(backend, &zero_area, "zero area");
    let mut inside = scene(6);
    let centre = inside.camera.centre_in_local();
    for i in 0..100 {
        (0..3).for_each(|k| inside.model.splats.positions[3 * i + k] = centre[k] as f32);
    }
    survives(backend, &inside, "camera inside");
    let mut hidden = scene(7);
    hidden.model.splats.opacity_logits.fill(-50.0);
    assert_eq!(survives(backend, &hidden, "nothing visible"), 0.0);
    let mut none =
        random_scene(&SceneOptions { num_splats: 0, width_px: 8, height_px: 8, ..SceneOptions::default() });
    assert_eq!(survives(backend, &none, "no splat"), 0.0);
    none.model = scene(8).model;
    none.model.textures.maps.iter_mut().for_each(|m| m.texel_sizes = [0.0; 2]);
    survives(backend, &none, "zero texel size");
}

/// Sizes down to a single pixel.
pub fn odd_image_sizes_are_rendered(backend: &mut dyn Backend) {
    for (w, h) in [(1, 1), (17, 13), (1, 300), (33, 2), (64, 64)] {
        let options = SceneOptions {
            num_splats: 300,
            width_px: w,
            height_px: h,
            scales: (0.1, 0.5),
            ..SceneOptions::default()
        };
        assert!(survives(backend, &random_scene(&options), &format!("{w}x{h}")) > 0.0);
    }
}
