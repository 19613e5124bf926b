//! Models built by hand for the scenes whose smallest model is known, and their fit to the photos.

use super::training::uploaded;
use litetex_gs::backend::{
    Backend as _, LearningRates, LossWeights, RenderOptions, StepRequest, TargetImage,
};
use litetex_gs::camera::{Camera, Similarity};
use litetex_gs::capture::{Capture, LoadOptions};
use litetex_gs::constants::SH_0;
use litetex_gs::eval::quality_of;
use litetex_gs::model::{Filter, Model, SplatArrays, TextureMap, TexturePool};
use litetex_gs::sample::{SampleOptions, write_sample};
use litetex_gs::views::ViewSource as _;
use std::sync::Arc;

/// Steps of a fit, ten per view.
const STEPS: u32 = 240;

/// What the photos show around a scene, display space.
const GREY: f32 = 128.0 / 255.0;

/// All views of a scene, in the frame of the capture.
pub struct Views(Vec<(Camera, Arc<TargetImage>)>);

impl Views {
    /// 24 views of `size` pixels, with 4 x 4 rays per pixel.
    pub fn new(scene: &str, [width_px, height_px]: [u32; 2]) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let options = SampleOptions {
            views: 24,
            width_px,
            height_px,
            supersampling: 4,
            points: 64,
            truth: false,
            scene: Some(scene.parse().unwrap()),
            ..SampleOptions::default()
        };
        write_sample(dir.path(), &options).unwrap();
        let capture = Capture::load(dir.path(), &LoadOptions::default()).unwrap();
        let local_from_capture = capture.capture_from_local.inverse();
        let views = (0..capture.num_views()).map(|view| {
            let camera = capture.camera(view);
            let camera_from_local = local_from_capture.rebase_camera(&camera.camera_from_local);
            (Camera { camera_from_local, ..camera }, capture.target(view).unwrap())
        });
        Self(views.collect())
    }

    /// Mean PSNR over the views, dB.
    pub fn psnr(&self, model: &Model) -> f64 {
        let mut backend = uploaded(model);
        let sh_degree = model.splats.sh_degree();
        let options = RenderOptions { background: [GREY; 3], sh_degree, geometry: false };
        let of = |(camera, target): &(Camera, Arc<TargetImage>)| {
            let image = backend.render(camera, &options).unwrap();
            quality_of("", &image.rgb, target).psnr.min(99.0)
        };
        self.0.iter().map(of).sum::<f64>() / self.0.len() as f64
    }

    /// The model with texels, and if `sh` says so SH coefficients, that fit the photos; and its PSNR.
    pub fn fit(&self, start: &Model, sh: bool) -> (Model, f64) {
        let mut backend = uploaded(start);
        for step in 1..=STEPS {
            let (camera, target) = &self.0[(7 * step as usize) % self.0.len()];
            let decay = 0.01_f32.powf(step as f32 / STEPS as f32);
            let rate = if sh { 0.02 * decay } else { 0.0 };
            let request = StepRequest {
                step,
                camera: *camera,
                photo: Some((7 * step) % self.0.len() as u32),
                target,
                background: [GREY; 3],
                sh_degree: start.splats.sh_degree(),
                loss: LossWeights { mse: 1.0, ..LossWeights::NONE },
                rates: LearningRates {
                    texel: 0.2 * decay,
                    sh_dc: rate,
                    sh_rest: rate,
                    ..LearningRates::default()
                },
                accumulate_statistics: false,
                exposure: None,
            };
            backend.step(&request).unwrap();
        }
        let model = backend.read_flushed().unwrap();
        let psnr = self.psnr(&model);
        (model, psnr)
    }
}

/// A splat that faces the cameras.
#[derive(Clone, Copy)]
pub struct Surfel {
    /// Metres.
    pub centre: [f64; 3],
    /// By which the axes are turned in the plane, radians.
    pub angle: f64,
    /// Standard deviation along both axes, metres.
    pub sigma: f64,
    pub opacity: f64,
    /// Texels along both axes; 0: no map.
    pub map: [u16; 2],
    /// Edges of a texel along both axes, metres.
    pub texel: [f64; 2],
    pub degree: u32,
}

impl Default for Surfel {
    fn default() -> Self {
        Self {
            centre: [0.0; 3],
            angle: 0.0,
            sigma: 1.0,
            opacity: 0.99,
            map: [0; 2],
            texel: [0.1; 2],
            degree: 0,
        }
    }
}

/// The model of some splats, grey and with texels that are 0.
pub fn model(surfels: &[Surfel]) -> Model {
    let mut splats = SplatArrays::zeros_of(surfels.iter().map(|s| s.degree as u8).collect());
    for (i, s) in surfels.iter().enumerate() {
        splats.positions[3 * i..3 * i + 3].copy_from_slice(&s.centre.map(|x| x as f32));
        let half = 0.5 * s.angle;
        splats.quaternions[4 * i..4 * i + 4].copy_from_slice(&[
            half.cos() as f32,
            0.0,
            0.0,
            half.sin() as f32,
        ]);
        splats.log_scales[2 * i..2 * i + 2].fill(s.sigma.ln() as f32);
        splats.opacity_logits[i] = (s.opacity / (1.0 - s.opacity)).ln() as f32;
        splats.sh_of_mut(i)[..3].fill((GREY - 0.5) / SH_0 as f32);
    }
    let maps =
        surfels.iter().map(|s| TextureMap::centred(s.map[0], s.map[1], s.texel.map(|edge| edge as f32)));
    Model {
        splats,
        textures: TexturePool::neutral(maps).unwrap(),
        near: 0.04,
        filter: Filter::Ewa,
        capture_from_local: Similarity::IDENTITY,
    }
}
