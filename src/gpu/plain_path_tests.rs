//! What the host leaves on the device, and does ahead, changes no bit: the same training by the plainest way.

use super::device::{GpuDevice, LimitChoice};
use super::form::GpuOptions;
use super::harness::test_drivers;
use super::model_buffers;
use super::state::GpuBackend;
use super::view_buffers::Capacity;
use crate::Result;
use crate::backend::{
    Backend, ComparedView, Costs, DensityPlan, DeviceInfo, DeviceLimits, Probe, RenderOptions, RenderedImage,
    SavedState, SceneShape, StepReport, StepRequest, TargetImage, WindowStatistics,
};
use crate::camera::Camera;
use crate::model::{AdamState, Model};
use crate::selftest::{SceneOptions, random_scene};
use crate::train::{Control, Policy, TrainConfig, TrainEvent, TrainState, train};
use crate::views::{Split, TestViews};
use std::sync::Arc;

/// One step or comparison at a time, each with a photo that is sent for it; states saved on the host, and uploaded to new buffers.
struct Plain(GpuBackend);

impl Backend for Plain {
    fn device(&self) -> DeviceInfo {
        self.0.device()
    }
    fn limits(&self, shape: SceneShape) -> DeviceLimits {
        self.0.limits(shape)
    }
    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        let gpu = &mut self.0;
        gpu.forget_photos();
        gpu.capacity = Capacity::default();
        model_buffers::forget(&gpu.device, &mut gpu.resources)?;
        gpu.upload(model, adam)
    }
    fn save(&mut self) -> Result<SavedState> {
        Ok(SavedState(Box::new(self.0.read_back()?)))
    }
    fn restore(&mut self, saved: &SavedState) -> Result<()> {
        let (model, adam) = saved.0.downcast_ref::<(Model, AdamState)>().unwrap();
        self.upload(model, adam)
    }
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        self.0.render(camera, options)
    }
    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
        self.0.step(&StepRequest { photo: None, ..*request })
    }
    fn squared_errors(&mut self, views: &[ComparedView<'_>]) -> Result<Vec<f64>> {
        let one = |view: &ComparedView<'_>| self.0.squared_errors(&[ComparedView { photo: None, ..*view }]);
        Ok(views.iter().map(one).collect::<Result<Vec<_>>>()?.concat())
    }
    fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>> {
        self.0.probe(probes)
    }
    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        self.0.read_statistics()
    }
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        self.0.set_statistics(statistics)
    }
    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        self.0.apply_plan(plan)
    }
    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        self.0.read_back()
    }
    fn read_flushed(&mut self) -> Result<Model> {
        self.0.read_flushed()
    }
}

/// Views of a scene from a row of cameras, with photos that agree with none of them.
fn views(model: &Model, camera: &Camera, gpu: &mut GpuBackend) -> Result<TestViews> {
    gpu.upload(model, &AdamState::zeros(model))?;
    let mut views = Vec::new();
    for name in ["0", "1", "2", "3", "4"] {
        let mut camera = *camera;
        camera.camera_from_local.translation.x += 0.05 * f64::from(views.len() as u32);
        let options = RenderOptions { background: [0.0; 3], sh_degree: 1, geometry: false };
        let image = gpu.render(&camera, &options)?;
        let rgb = image.rgb.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        views.push((name, camera, Arc::new(TargetImage::opaque(image.width_px, image.height_px, rgb))));
    }
    Ok(TestViews(Split::Train, views))
}

#[test]
fn the_plainest_way_to_train_gives_the_same_bytes() {
    let open = |batch_steps| {
        let choice = test_drivers().into_iter().next()?;
        let device = GpuDevice::open(&choice, LimitChoice::Downlevel).unwrap();
        Some(GpuBackend::new(device, GpuOptions { batch_steps, ..GpuOptions::default() }).unwrap())
    };
    let (Some(mut gpu), Some(plain)) = (open(None), open(Some(1))) else { return };
    let scene = random_scene(&SceneOptions {
        num_splats: 150,
        sh_degree: 1,
        width_px: 40,
        height_px: 30,
        scales: (0.05, 0.2),
        opacities: (0.3, 0.9),
        depths: (0.8, 2.0),
        ..SceneOptions::default()
    });
    let views = views(&scene.model, &scene.camera, &mut gpu).unwrap();
    let mut start = scene.model;
    start.splats.sh.fill(0.0);
    start.textures.texels.fill(0.0);
    let start = TrainState::fresh(start);
    let trained = |backend: &mut dyn Backend, seed| {
        let config = TrainConfig {
            steps: 200,
            sh_degree: 1,
            policy: Policy::Litetex,
            eval_every: 0,
            save_every: 0,
            seed,
            ..TrainConfig::default()
        };
        let mut saved_parameters = 0;
        let mut sink = |event: TrainEvent<'_>| {
            if let TrainEvent::Pruned(pruned) = event {
                saved_parameters += pruned.params_before - pruned.params;
            }
            Ok(Control::Continue)
        };
        let (state, _) = train(&config, backend, &views, start.clone(), &mut sink).unwrap();
        assert!(saved_parameters > 0, "no round was tested");
        (state.model, state.adam)
    };
    let before = gpu.device.work();
    let expected = trained(&mut gpu, 1);
    let mut plain = Plain(plain);
    assert!(trained(&mut plain, 1) == expected);
    // They went other ways indeed.
    let [ours, plainly] = [gpu.device.work(), plain.0.device.work()];
    println!("{before:?}\n{ours:?}\n{plainly:?}");
    assert!(plainly.uploads > 3 && ours.uploads == before.uploads + 1);
    assert!(plainly.photos > 200 && ours.photos < before.photos + 100);
    assert!(ours.overlapping > before.overlapping + 10);
    // Negative control.
    assert!(trained(&mut gpu, 2) != expected);
}
