//! Checks whether a backend computes what the reference computes. Everything is observed through the trait, so
//! that the same checks apply to every backend: gradients are read from the first moments after one step, which
//! are `(1 - beta1)` times the gradient.

use super::random_scene::{RandomScene, SceneOptions, random_scene};
use crate::Result;
use crate::backend::{Backend, ColourMap, LearningRates, LossWeights, RenderOptions, StepRequest};
use crate::constants::ADAM_BETA1;
use crate::model::{AdamState, SplatGroup};
use crate::reference::{
    AlphaCutoff, ColourGradient, Gradients, Params, Settings, adam_dense, exposure_fwd, gradients, map_rate,
};
use serde::Serialize;

const WEIGHTS: LossWeights =
    LossWeights { l1: 0.8, dssim: 0.2, mse: 0.0, opacity: 0.01, texture: 1e-8, ..LossWeights::NONE };
/// All terms, including those on depths and normals, which have code paths of their own.
const ALL_WEIGHTS: LossWeights = LossWeights { mse: 0.03, distortion: 10.0, normal: 0.05, ..WEIGHTS };
const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];
/// Mixes all channels and is far from the identity.
const EXPOSURE: ColourMap =
    ColourMap([[1.3, 0.1, -0.05, 0.02], [0.05, 0.8, 0.1, -0.04], [-0.1, 0.15, 1.1, 0.06]]);
const STEPS: u32 = 10;
const RATES: LearningRates = LearningRates {
    position: 2e-4,
    quaternion: 1e-3,
    log_scale: 5e-3,
    opacity: 0.02,
    sh_dc: 2.5e-3,
    sh_rest: 1.25e-4,
    texel: 2e-3,
    texel_growth: 0.5,
    texel_growth_limit: 4.0,
};

/// Result of a comparison with the reference.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// Scene and quantity compared.
    pub name: String,
    /// Root mean square of the difference over that of the reference; for depths and normals, the share of
    /// values that differ.
    pub difference: f64,
    /// Largest difference that passes.
    pub limit: f64,
    /// Whether it passed.
    pub passed: bool,
}

impl Check {
    /// Compares by the root mean square. Fails if the reference is zero everywhere, since that would test nothing.
    fn new(name: impl Into<String>, got: &[f64], expected: &[f64], limit: f64) -> Self {
        let square = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>();
        let off = square(&mut got.iter().zip(expected).map(|(g, e)| g - e));
        let size = square(&mut expected.iter().copied());
        let difference =
            if size > 0.0 && got.len() == expected.len() { (off / size).sqrt() } else { f64::NAN };
        Self { name: name.into(), difference, limit, passed: difference <= limit }
    }
}

/// Compares by the share of values that differ by more than 1/1000 of the largest. Depths and normals change
/// arbitrarily where f32 rounding moves a pixel into or out of a support.
fn share_off(name: String, got: &[f64], expected: &[f64], limit: f64) -> Check {
    let largest = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let off =
        got.iter().zip(expected).filter(|(g, e)| (*g - *e).abs() > 1e-3 * largest || g.is_nan()).count();
    let comparable = largest > 0.0 && got.len() == expected.len();
    let difference = if comparable { off as f64 / expected.len() as f64 } else { f64::NAN };
    Check { name, difference, limit, passed: difference <= limit }
}

/// Compares a backend with the reference on small random scenes: images, all gradients, and ten training steps.
///
/// # Errors
/// Errors of the backend. A difference is not an error, but a failed [`Check`].
pub fn run(backend: &mut dyn Backend) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for sh_degree in [0, 3] {
        let options = SceneOptions {
            num_splats: 400,
            sh_degree,
            map_sizes: vec![(4, 4), (2, 2), (9, 5), (0, 0)],
            width_px: 83,
            height_px: 61,
            scales: (0.02, 0.15),
            opacities: (0.05, 0.8),
            seed: 11 + u64::from(sh_degree),
            ..SceneOptions::default()
        };
        let scene = random_scene(&options);
        let name = |what: &str| format!("SH degree {sh_degree}: {what}");
        checks.push(image(backend, &scene, name("image"))?);
        checks.extend(first_step(backend, &scene, &WEIGHTS, ColourMap::IDENTITY, &name)?);
        checks.extend(ten_steps(backend, &scene, &name)?);
    }
    // Texels smaller than pixels, whose gradients the kernels for hardware sum in a different way. With this seed no splat
    // grazes a pixel's centre, which decides whether its map is regularised.
    let mut scene = random_scene(&SceneOptions {
        num_splats: 300,
        sh_degree: 1,
        map_sizes: vec![(40, 40), (33, 7)],
        width_px: 83,
        height_px: 61,
        scales: (0.02, 0.15),
        opacities: (0.3, 0.95),
        seed: 18,
        ..SceneOptions::default()
    });
    let name = |what: &str| format!("large maps: {what}");
    checks.push(image(backend, &scene, name("image"))?);
    checks.extend(first_step(backend, &scene, &WEIGHTS, ColourMap::IDENTITY, &name)?);
    let name = |what: &str| format!("depth terms: {what}");
    checks.extend(depths_and_normals(backend, &scene, &name)?);
    checks.extend(first_step(backend, &scene, &ALL_WEIGHTS, ColourMap::IDENTITY, &name)?);
    let name = |what: &str| format!("exposure and alpha: {what}");
    let num_pixels = scene.target.rgb.len() / 3;
    scene.target.alpha = Some((0..num_pixels).map(|i| (i * 7 % 128) as u8).collect());
    checks.extend(first_step(backend, &scene, &WEIGHTS, EXPOSURE, &name)?);
    checks.push(colour_sums(backend, &scene, name("sums"))?);
    Ok(checks)
}

fn settings(scene: &RandomScene, exposure: ColourMap) -> Settings {
    Settings {
        cutoff: AlphaCutoff::Hard,
        colour_gradient: ColourGradient::Projected,
        near: f64::from(scene.model.near),
        filter_px2: scene.model.filter.variance_px2(),
        sh_degree: scene.model.splats.sh_degree(),
        background: BACKGROUND.map(f64::from),
        exposure,
    }
}

fn reference(scene: &RandomScene, params: &Params, loss: &LossWeights, exposure: ColourMap) -> Gradients {
    gradients(params, &scene.camera, &scene.target, loss, &settings(scene, exposure))
}

fn request<'a>(scene: &'a RandomScene, step: u32, loss: &LossWeights) -> StepRequest<'a> {
    StepRequest {
        step,
        camera: scene.camera,
        photo: None,
        target: &scene.target,
        background: BACKGROUND,
        sh_degree: scene.model.splats.sh_degree(),
        loss: *loss,
        rates: RATES,
        accumulate_statistics: false,
        exposure: None,
    }
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}

fn image(backend: &mut dyn Backend, scene: &RandomScene, name: String) -> Result<Check> {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model))?;
    let options =
        RenderOptions { background: BACKGROUND, sh_degree: scene.model.splats.sh_degree(), geometry: false };
    let image = backend.render(&scene.camera, &options)?;
    let expected = reference(scene, &Params::from_model(&scene.model), &WEIGHTS, ColourMap::IDENTITY).image;
    Ok(Check::new(name, &wide(&image.rgb), &expected.rgb, 1e-4))
}

/// Checks depths and normals of an image.
fn depths_and_normals(
    backend: &mut dyn Backend,
    scene: &RandomScene,
    name: &dyn Fn(&str) -> String,
) -> Result<Vec<Check>> {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model))?;
    let sh_degree = scene.model.splats.sh_degree();
    let options = RenderOptions { background: BACKGROUND, sh_degree, geometry: true };
    let image = backend.render(&scene.camera, &options)?;
    let expected = reference(scene, &Params::from_model(&scene.model), &WEIGHTS, ColourMap::IDENTITY).image;
    let normals: Vec<f64> = expected.normal.iter().flat_map(|n| n.to_array()).collect();
    // Needed 0 on the CPU backend; 2 values of 1,000 may flip.
    Ok(vec![
        share_off(name("depths"), &wide(&image.depth), &expected.depth, 2e-3),
        share_off(name("normals"), &wide(&image.normal), &normals, 2e-3),
    ])
}

/// Checks the gradients, by the first moments after one step.
fn first_step(
    backend: &mut dyn Backend,
    scene: &RandomScene,
    loss: &LossWeights,
    exposure: ColourMap,
    name: &dyn Fn(&str) -> String,
) -> Result<Vec<Check>> {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model))?;
    let corrected = (exposure != ColourMap::IDENTITY).then_some(exposure);
    backend.step(&StepRequest { exposure: corrected, ..request(scene, 1, loss) })?;
    let (_, adam) = backend.read_back()?;
    let expected = reference(scene, &Params::from_model(&scene.model), loss, exposure).params;
    let gradient = |m: &[f32]| m.iter().map(|&m| f64::from(m) / (1.0 - ADAM_BETA1)).collect::<Vec<_>>();
    // f32 rounding may flip pixels at the edge of a support, which shows in two of a thousand gradients.
    let limit = 5e-3;
    let mut checks: Vec<Check> = SplatGroup::ALL
        .into_iter()
        .map(|group| {
            let title = name(&format!("gradient of {group:?}"));
            Check::new(title, &gradient(adam.splats_m.group(group)), expected.splats.group(group), limit)
        })
        .collect();
    checks.push(Check::new(name("gradient of Texel"), &gradient(&adam.texels_m), &expected.texels, limit));
    Ok(checks)
}

/// Checks the sums from which an exposure is estimated.
fn colour_sums(backend: &mut dyn Backend, scene: &RandomScene, name: String) -> Result<Check> {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model))?;
    let report = backend.step(&StepRequest { exposure: Some(EXPOSURE), ..request(scene, 1, &WEIGHTS) })?;
    let rendered = reference(scene, &Params::from_model(&scene.model), &WEIGHTS, EXPOSURE).image;
    let (_, expected) = exposure_fwd(&rendered.rgb, &scene.target, BACKGROUND.map(f64::from), &EXPOSURE);
    // Needed 2e-6.
    Ok(Check::new(name, &report.colour_sums.unwrap_or_default().0, &expected.0, 1e-4))
}

/// Checks the change of the parameters over ten steps.
fn ten_steps(
    backend: &mut dyn Backend,
    scene: &RandomScene,
    name: &dyn Fn(&str) -> String,
) -> Result<Vec<Check>> {
    backend.upload(&scene.model, &AdamState::zeros(&scene.model))?;
    // As one batch, like the trainer.
    let requests: Vec<StepRequest<'_>> = (1..=STEPS).map(|t| request(scene, t, &WEIGHTS)).collect();
    backend.steps(&requests)?;
    let got = Params::from_model(&backend.read_flushed()?);
    let start = Params::from_model(&scene.model);
    let mut params = start.clone();
    let (mut m, mut v) = (start.zeros_like(), start.zeros_like());
    let texel_rates: Vec<f64> = (start.maps.iter())
        .flat_map(|map| vec![map_rate(&RATES, map.num_texels()); map.floats().len()])
        .collect();
    for t in 1..=STEPS {
        let gradient = reference(scene, &params, &WEIGHTS, ColourMap::IDENTITY).params;
        for group in SplatGroup::ALL {
            let [p, m, v] = [&mut params, &mut m, &mut v].map(|all| all.splats.group_mut(group));
            adam([p, m, v], gradient.splats.group(group), t, |i| f64::from(rate(&start, group, i)));
        }
        adam([&mut params.texels, &mut m.texels, &mut v.texels], &gradient.texels, t, |i| texel_rates[i]);
    }
    let change = |p: &[f64], start: &[f64]| p.iter().zip(start).map(|(p, s)| p - s).collect::<Vec<_>>();
    // Adam turns a tiny gradient into a full step, so that rounding of its sign shows: needed 0.084.
    let limit = 0.1;
    let mut checks: Vec<Check> = SplatGroup::ALL
        .into_iter()
        .map(|group| {
            let [got, want] =
                [&got, &params].map(|p| change(p.splats.group(group), start.splats.group(group)));
            Check::new(name(&format!("ten steps of {group:?}")), &got, &want, limit)
        })
        .collect();
    let (got, want) = (change(&got.texels, &start.texels), change(&params.texels, &start.texels));
    checks.push(Check::new(name("ten steps of Texel"), &got, &want, limit));
    Ok(checks)
}

/// The learning rate of a float of a group.
fn rate(params: &Params, group: SplatGroup, float: usize) -> f32 {
    let is_dc = || {
        let splat = params.splats.sh_offsets().partition_point(|&first| first as usize <= float) - 1;
        float < params.splats.sh_offsets()[splat] as usize + 3
    };
    match group {
        SplatGroup::Position => RATES.position,
        SplatGroup::Quaternion => RATES.quaternion,
        SplatGroup::LogScale => RATES.log_scale,
        SplatGroup::Opacity => RATES.opacity,
        SplatGroup::Sh if is_dc() => RATES.sh_dc,
        SplatGroup::Sh => RATES.sh_rest,
    }
}

fn adam([p, m, v]: [&mut [f64]; 3], gradient: &[f64], t: u32, rate: impl Fn(usize) -> f64) {
    for i in 0..p.len() {
        (p[i], m[i], v[i]) = adam_dense((p[i], m[i], v[i]), gradient[i], rate(i), t);
    }
}
