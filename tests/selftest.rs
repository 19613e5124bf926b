//! The self-test passes on the CPU backend and fails on one that computes slightly wrongly.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use litetex_gs::Result;
use litetex_gs::backend::{
    Backend, DeviceInfo, RenderOptions, RenderedImage, StepReport, StepRequest, StructurePlan,
    WindowStatistics,
};
use litetex_gs::camera::Camera;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::{AdamState, Model};
use litetex_gs::selftest;

/// A broken driver: the photo that the loss sees is one pixel off.
struct Broken(CpuBackend);

impl Backend for Broken {
    fn device(&self) -> DeviceInfo {
        self.0.device()
    }
    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        self.0.upload(model, adam)
    }
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        self.0.render(camera, options)
    }
    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
        let mut target = request.target.clone();
        target.rgb.rotate_left(3);
        self.0.step(&StepRequest { target: &target, ..*request })
    }
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        self.0.set_statistics(statistics)
    }

    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        self.0.read_statistics()
    }
    fn apply_plan(&mut self, plan: &StructurePlan) -> Result<()> {
        self.0.apply_plan(plan)
    }
    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        self.0.read_back()
    }
    fn read_settled(&mut self) -> Result<Model> {
        self.0.read_settled()
    }
}

#[test]
fn the_cpu_passes_and_a_broken_device_does_not() {
    let checks = selftest::run(&mut CpuBackend::new(Some(2)).unwrap()).unwrap();
    checks.iter().for_each(|c| println!("{:<40} {:.2e} of {:.1e}", c.name, c.difference, c.limit));
    assert!(checks.iter().all(|c| c.passed), "{checks:#?}");
    let broken = selftest::run(&mut Broken(CpuBackend::new(Some(2)).unwrap())).unwrap();
    let of = |what: &str| broken.iter().filter(|c| c.name.contains(what)).collect::<Vec<_>>();
    assert!(of("picture").iter().all(|c| c.passed), "rendering is sound");
    assert!(of("gradient").iter().all(|c| !c.passed), "{broken:#?}");
}
