//! Compares what a backend computes for a view, observed only through its trait, with the f64 reference.

use super::compare;
use litetex_gs::backend::{
    Backend, ColourMap, LearningRates, LossValues, LossWeights, RenderOptions, RenderedImage, StepRequest,
    WindowStatistics,
};
use litetex_gs::constants::ADAM_BETA1;
use litetex_gs::model::{AdamState, Filter, SplatArrays, SplatGroup};
use litetex_gs::reference::{
    AlphaCutoff, ColourGradient, Gradients, Params, Settings, adam_skipped, gradients, map_rate,
};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};

pub const WEIGHTS: LossWeights = LossWeights {
    l1: 0.8,
    dssim: 0.2,
    mse: 0.03,
    opacity: 0.01,
    texture: 1e-6,
    distortion: 100.0,
    normal: 0.05,
};
pub const BACKGROUND: [f32; 3] = [0.3, 0.5, 0.2];

/// The results of the reference.
pub fn reference(scene: &RandomScene, weights: &LossWeights) -> Gradients {
    let settings = Settings {
        cutoff: AlphaCutoff::Hard,
        colour_gradient: ColourGradient::Projected,
        near: f64::from(scene.model.near),
        filter_px2: scene.model.filter.variance_px2(),
        sh_degree: scene.model.splats.sh_degree(),
        background: BACKGROUND.map(f64::from),
        exposure: ColourMap::IDENTITY,
    };
    gradients(&Params::from_model(&scene.model), &scene.camera, &scene.target, weights, &settings)
}

/// The results of a backend.
#[derive(Clone, Debug, PartialEq)]
pub struct Observed {
    /// Gradients with respect to the splats' parameters.
    pub splats: SplatArrays,
    /// Gradients with respect to the texels. `[num_texels, 3]`
    pub texels: Vec<f32>,
    pub image: RenderedImage,
    pub loss: LossValues,
    pub statistics: WindowStatistics,
}

/// Renders, and takes one step with learning rates of zero. Gradients are read from the first moments, which are
/// `(1 - beta1)` times the gradient.
pub fn observe(backend: &mut dyn Backend, scene: &RandomScene, weights: &LossWeights) -> Observed {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let sh_degree = scene.model.splats.sh_degree();
    let options = RenderOptions { background: BACKGROUND, sh_degree, geometry: false };
    let image = backend.render(&scene.camera, &options).unwrap();
    let request = StepRequest {
        step: 1,
        camera: scene.camera,
        photo: None,
        target: &scene.target,
        background: BACKGROUND,
        sh_degree,
        loss: *weights,
        rates: LearningRates::default(),
        accumulate_statistics: true,
        exposure: None,
    };
    let report = backend.step(&request).unwrap();
    let statistics = backend.read_statistics().unwrap();
    let (_, adam) = backend.read_back().unwrap();
    let gradient = |m: &Vec<f32>| m.iter().map(|m| m / (1.0 - ADAM_BETA1) as f32).collect::<Vec<f32>>();
    let mut splats = adam.splats_m.clone();
    for group in SplatGroup::ALL {
        *splats.group_mut(group) = gradient(adam.splats_m.group(group));
    }
    Observed { splats, texels: gradient(&adam.texels_m), image, loss: report.loss, statistics }
}

/// Whether both agree; prints the differences. `texel_rms` is the largest rms error of the texel gradients.
pub fn agree(scene: &RandomScene, got: &Observed, expected: &Gradients, texel_rms: f64) -> bool {
    // Splats that graze a pixel centre within the margin of the bounds count as seen: needed 9 in 3,000. Only the
    // backend applies the texture term to their maps, which are therefore not compared.
    let visible: Vec<bool> = got.statistics.seen.iter().map(|&s| s > 0).collect();
    let flipped: Vec<usize> = (0..visible.len()).filter(|&i| visible[i] != expected.visible[i]).collect();
    let mut ok = flipped.len() * 200 <= visible.len();
    let mut texels = got.texels.clone();
    for t in flipped.iter().flat_map(|&i| scene.model.textures.maps[i].floats()) {
        texels[t] = expected.params.texels[t] as f32;
    }
    let mut check = |name: &str, got: &[f32], expected: &[f64], limit: f64, share: f64, rms: f64| {
        let d = compare(got, expected, limit);
        println!("{name:>12}: {d:?}");
        ok &= d.beyond as f64 <= share * d.entries as f64 && d.rms < rms && d.non_zero * 12 > d.entries;
    };
    // A pixel at the edge of a support may flip by 1/255 of a colour: at most 2 in 1,000.
    check("image", &got.image.rgb, &expected.image.rgb, 2e-5, 2e-3, 1e-4);
    for group in SplatGroup::ALL {
        let want = expected.params.splats.group(group);
        check(&format!("{group:?}"), got.splats.group(group), want, 2e-4, 4e-3, 1e-3);
    }
    check("Texel", &texels, &expected.params.texels, 2e-4, 2e-3, texel_rms);
    let statistics = [&got.statistics.area, &got.statistics.contribution, &got.statistics.error];
    let pixels = scene.camera.pinhole.num_pixels() as f64;
    for (k, got) in statistics.into_iter().enumerate() {
        let expected: Vec<f64> = expected.statistics.iter().map(|s| s[k] / pixels).collect();
        check(&format!("statistic {k}"), got, &expected, 2e-4, 4e-3, 1e-3);
    }
    let (a, b) = (got.loss, expected.loss);
    println!("{a:?}\n{b:?}");
    let close = |a: f64, b: f64, limit: f64| (a - b).abs() <= limit * b.abs();
    ok &= close(a.l1, b.l1, 1e-6) && close(a.dssim, b.dssim, 1e-6) && close(a.mse, b.mse, 1e-6);
    // The filter widens splats seen nearly edge-on along the ray, where f32 depths are off: needed 3.5e-5, else 4e-8.
    let distortion_limit = if scene.model.filter == Filter::Ewa { 1e-4 } else { 1e-5 };
    ok &= close(a.distortion, b.distortion, distortion_limit) && close(a.normal, b.normal, 1e-4);
    // These two are sums over the visible splats, including flipped ones.
    ok & close(a.opacity, b.opacity, 5e-3) & close(a.texture, b.texture, 5e-3)
}

/// Scenes of thousands of splats: mixed, opaque, with coarse maps, with fine maps, near the camera.
pub fn scenes() -> Vec<SceneOptions> {
    // Translucent and small, so that most splats receive a gradient.
    let base = SceneOptions { scales: (0.01, 0.1), opacities: (0.02, 0.6), ..SceneOptions::default() };
    let opaque = SceneOptions { opacities: (0.3, 0.9999), seed: 5, ..base.clone() };
    let coarse =
        SceneOptions { sh_degree: 0, seed: 2, filter: Filter::None, map_sizes: vec![(4, 4)], ..base.clone() };
    let fine =
        SceneOptions { sh_degree: 1, seed: 3, map_sizes: vec![(33, 7), (2, 2), (5, 64)], ..base.clone() };
    let near =
        SceneOptions { sh_degree: 2, seed: 4, scales: (0.05, 1.5), depths: (0.05, 1.0), ..base.clone() };
    vec![
        SceneOptions { num_splats: 3_000, ..base },
        SceneOptions { num_splats: 2_000, ..opaque },
        SceneOptions { num_splats: 2_000, ..coarse },
        SceneOptions { num_splats: 1_000, width_px: 67, height_px: 131, ..fine },
        SceneOptions { num_splats: 300, width_px: 90, height_px: 70, ..near },
    ]
}

/// Flushes texels by seven steps. Returns the largest difference from the reference, over the largest change of
/// a texel. `growth` is the `texel_growth` of the backend's learning rates and of the reference's.
fn flushed_texels_off(backend: &mut dyn Backend, scene: &RandomScene, growth: [f32; 2]) -> f64 {
    let [rates, expected] = growth.map(|texel_growth| LearningRates {
        texel: 2e-3,
        texel_growth,
        texel_growth_limit: 4.0,
        ..LearningRates::default()
    });
    let mut adam = AdamState { step: 10, rates, ..AdamState::zeros(&scene.model) };
    adam.last_step.fill(3);
    adam.texels_m.fill(0.3);
    adam.texels_v.fill(0.02);
    backend.upload(&scene.model, &adam).unwrap();
    let flushed = backend.read_flushed().unwrap();
    let (mut off, mut change) = (0.0_f64, 0.0_f64);
    for map in &scene.model.textures.maps {
        for f in map.floats() {
            let state = (f64::from(scene.model.textures.texels[f]), 0.3, 0.02);
            let want = adam_skipped(state, map_rate(&expected, map.num_texels()), 3, 7).0;
            off = off.max((f64::from(flushed.textures.texels[f]) - want).abs());
            change = change.max((want - state.0).abs());
        }
    }
    off / change
}

/// Whether lagging texels are flushed at the learning rate of their map: needed 1.3e-5, the rounding of the texels.
pub fn texels_flush_at_the_rate_of_their_map(backend: &mut dyn Backend) -> bool {
    let scene = random_scene(&SceneOptions { num_splats: 60, ..SceneOptions::default() });
    let off = flushed_texels_off(backend, &scene, [0.5, 0.5]);
    println!("flushed texels: {off:.1e}");
    // Negative control: slightly more growth.
    assert!(flushed_texels_off(backend, &scene, [0.5, 0.501]) > 1e-3);
    off < 5e-5
}
