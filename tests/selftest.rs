//! The self-test passes on the CPU backend, and fails on backends with slight faults.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use litetex_gs::Result;
use litetex_gs::backend::{
    Backend, Costs, DensityPlan, DeviceInfo, DeviceLimits, Probe, RenderOptions, RenderedImage, SavedState,
    SceneShape, StepReport, StepRequest, WindowStatistics,
};
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::selftest;

/// Fault of a broken driver.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    /// The loss uses a photo that is shifted by one pixel.
    Photo,
    /// Terms on depths and normals have no effect, and rendered depths and normals are shifted by one pixel.
    Depths,
    /// Texels of maps above 9 blocks of 4 x 4 get no gradient.
    LargeMaps,
}

/// The CPU backend with a fault.
struct Broken(CpuBackend, Fault);

impl Backend for Broken {
    fn device(&self) -> DeviceInfo {
        self.0.device()
    }
    fn limits(&self, shape: SceneShape) -> DeviceLimits {
        self.0.limits(shape)
    }
    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        self.0.upload(model, adam)
    }
    fn save(&mut self) -> Result<SavedState> {
        self.0.save()
    }
    fn restore(&mut self, saved: &SavedState) -> Result<()> {
        self.0.restore(saved)
    }
    fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>> {
        self.0.probe(probes)
    }
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        let mut image = self.0.render(camera, options)?;
        if self.1 == Fault::Depths && options.geometry {
            image.depth.rotate_left(1);
            image.normal.rotate_left(3);
        }
        Ok(image)
    }
    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
        let (mut target, mut loss) = (request.target.clone(), request.loss);
        match self.1 {
            Fault::Photo => target.rgb.rotate_left(3),
            Fault::Depths => (loss.distortion, loss.normal) = (0.0, 0.0),
            Fault::LargeMaps => {}
        }
        self.0.step(&StepRequest { target: &target, loss, ..*request })
    }
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        self.0.set_statistics(statistics)
    }

    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        self.0.read_statistics()
    }
    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        self.0.apply_plan(plan)
    }
    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        let (model, mut adam) = self.0.read_back()?;
        if self.1 == Fault::LargeMaps {
            for map in model.textures.maps.iter().filter(|map| map.num_texels() > 9 * 16) {
                adam.texels_m[map.floats()].fill(0.0);
            }
        }
        Ok((model, adam))
    }
    fn read_flushed(&mut self) -> Result<Model> {
        self.0.read_flushed()
    }
}

#[test]
fn the_self_test_passes_on_the_cpu_and_fails_on_broken_devices() {
    let checks = selftest::run(&mut CpuBackend::new(Some(2)).unwrap()).unwrap();
    checks.iter().for_each(|c| println!("{:<40} {:.2e} of {:.1e}", c.name, c.difference, c.limit));
    assert!(checks.iter().all(|c| c.passed), "{checks:#?}");
    let broken_by = |fault| {
        let broken = selftest::run(&mut Broken(CpuBackend::new(Some(2)).unwrap(), fault)).unwrap();
        let failed = broken.into_iter().filter(|c| !c.passed).map(|c| c.name);
        failed.collect::<Vec<_>>()
    };
    let failed = broken_by(Fault::Photo);
    assert!(failed.iter().all(|name| !name.contains("image")), "rendering is not affected: {failed:#?}");
    let gradients = checks.iter().filter(|c| c.name.contains("gradient"));
    gradients.for_each(|c| assert!(failed.contains(&c.name), "{}: {failed:#?}", c.name));
    let failed = broken_by(Fault::Depths);
    assert!(failed.iter().all(|name| name.starts_with("depth terms")), "{failed:#?}");
    for what in ["depths", "normals", "gradient of Position", "gradient of Quaternion"] {
        assert!(failed.contains(&format!("depth terms: {what}")), "{what}: {failed:#?}");
    }
    let failed = broken_by(Fault::LargeMaps);
    assert_eq!(
        failed,
        ["large maps", "depth terms", "exposure and alpha"].map(|case| format!("{case}: gradient of Texel"))
    );
}
