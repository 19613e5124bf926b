//! A small scene to train on, from memory instead of files.

use litetex_gs::Result;
use litetex_gs::backend::{Backend as _, RenderOptions, TargetImage};
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};
use litetex_gs::train::density::Components;
use litetex_gs::train::{Policy, TrainConfig};
use litetex_gs::views::{Split, ViewSource};
use std::sync::Arc;

/// Options with which the photos are rendered.
pub const BLACK: RenderOptions = RenderOptions { background: [0.0; 3], sh_degree: 1, geometry: false };

/// Views rendered from a model; the first is the test view.
pub struct MemoryViews(pub Vec<(Camera, Arc<TargetImage>)>);

impl ViewSource for MemoryViews {
    fn num_views(&self) -> usize {
        self.0.len()
    }
    fn name(&self, _view: usize) -> &str {
        "memory"
    }
    fn split(&self, view: usize) -> Split {
        if view == 0 { Split::Test } else { Split::Train }
    }
    fn camera(&self, view: usize) -> Camera {
        self.0[view].0
    }
    fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
        Ok(self.0[view].1.clone())
    }
}

/// Splats with maps of 4 x 4 texels that cover most of an image of 64 x 48 pixels.
pub fn scene_options() -> SceneOptions {
    SceneOptions {
        num_splats: 300,
        sh_degree: 1,
        map_sizes: vec![(4, 4)],
        width_px: 64,
        height_px: 48,
        scales: (0.05, 0.2),
        opacities: (0.3, 0.9),
        depths: (0.8, 2.0),
        ..SceneOptions::default()
    }
}

/// The scene of [`scene_options`].
pub fn scene() -> RandomScene {
    random_scene(&scene_options())
}

/// A backend with the model and zero moments.
pub fn uploaded(model: &Model) -> CpuBackend {
    let mut backend = CpuBackend::new(Some(2)).unwrap();
    backend.upload(model, &AdamState::zeros(model)).unwrap();
    backend
}

/// Photos of the scene from a row of cameras.
pub fn photos(scene: &RandomScene) -> MemoryViews {
    let mut backend = uploaded(&scene.model);
    let views = (0..6).map(|i| {
        let mut camera = scene.camera;
        camera.camera_from_local.translation.x += 0.05 * (f64::from(i) - 2.5);
        let image = backend.render(&camera, &BLACK).unwrap();
        let rgb = image.rgb.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        (camera, Arc::new(TargetImage::opaque(camera.pinhole.width_px, camera.pinhole.height_px, rgb)))
    });
    MemoryViews(views.collect())
}

/// The scene's model without colours and with jittered centres.
pub fn damaged(scene: &RandomScene) -> Model {
    let mut model = scene.model.clone();
    model.splats.sh.fill(0.0);
    model.textures.texels.fill(0.0);
    model.splats.positions.iter_mut().enumerate().for_each(|(i, p)| *p += 0.01 * (i as f32).sin());
    model
}

/// Evaluates half-way, and saves every 7 steps.
pub fn config(steps: u32) -> TrainConfig {
    TrainConfig {
        steps,
        sh_degree: 1,
        policy: Policy::Fixed(4),
        // Without the scheduler, photos are read only when their steps come.
        components: Components { scheduler: false, ..Components::default() },
        eval_every: steps / 2,
        save_every: 7,
        ..TrainConfig::default()
    }
}
