//! Harness for tests of single kernels: an open device whose buffers are filled by hand.

use super::adapter::{AdapterChoice, Adapters};
use super::device::{GpuDevice, LimitChoice, Pipeline, UNIFORM_STRIDE};
use super::encode::{Dispatch, encode};
use super::kernels::{Buf, Groups, KernelId, NUM_GROUPS};
use super::layout::{DispatchArgs, SortPass, StepUniform};
use super::resources::Resources;
use std::collections::BTreeMap;

/// All software drivers, lavapipe first; without any, the first adapter; without any adapter, prints that the test
/// is skipped. `LITETEX_REQUIRE_GPU` is the number of software drivers that must exist.
pub(super) fn test_drivers() -> Vec<AdapterChoice> {
    let adapters = Adapters::enumerate().usable;
    let mut software: Vec<_> = adapters.iter().filter(|a| !a.hardware).cloned().collect();
    software.sort_by_key(|a| a.name != "lavapipe");
    let required = std::env::var("LITETEX_REQUIRE_GPU").ok().and_then(|n| n.parse().ok()).unwrap_or(0);
    assert!(software.len() >= required, "{required} software Vulkan drivers required, found {adapters:?}");
    if !software.is_empty() {
        return software;
    }
    if adapters.is_empty() {
        println!("skipped: no Vulkan driver is installed");
    }
    adapters.into_iter().take(1).collect()
}

/// A device, the kernels under test and their buffers.
pub(super) struct Harness {
    pub device: GpuDevice,
    pub resources: Resources,
    pipelines: BTreeMap<KernelId, Pipeline>,
}

impl Harness {
    /// A harness on each of [`test_drivers`] in turn, within the minimum limits.
    pub(super) fn on_each_driver(kernels: &[KernelId]) -> impl Iterator<Item = Self> {
        test_drivers().into_iter().map(|choice| Self::on(&choice, kernels))
    }

    /// A harness on the first of [`test_drivers`].
    pub(super) fn new(kernels: &[KernelId]) -> Option<Self> {
        Self::on_each_driver(kernels).next()
    }

    fn on(choice: &AdapterChoice, kernels: &[KernelId]) -> Self {
        println!("{}", choice.name);
        let device = GpuDevice::open(choice, LimitChoice::Downlevel).unwrap();
        let steps = device.uniforms("steps", 4).unwrap();
        let sort_passes = device.uniforms("sort passes", 16).unwrap();
        let pipelines = device.pipelines(kernels, &[], true).unwrap();
        let mut harness = Self { device, resources: Resources::new(steps, sort_passes), pipelines };
        harness.fill(Buf::Args, &vec![DispatchArgs::default(); NUM_GROUPS as usize]);
        harness
    }

    /// Sets a buffer to these values.
    pub(super) fn fill<T: bytemuck::Pod>(&mut self, name: Buf, values: &[T]) {
        let buffer =
            self.device.buffer(&format!("{name:?}"), values.len() as u64, size_of::<T>() as u64).unwrap();
        self.device.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(values));
        self.resources.set(name, buffer);
    }

    /// Sets a buffer to zeros.
    pub(super) fn zeros(&mut self, name: Buf, bytes: usize) {
        self.fill(name, &vec![0_u32; bytes / 4]);
    }

    pub(super) fn set_step(&mut self, slot: u32, step: &StepUniform) {
        let at = u64::from(slot) * UNIFORM_STRIDE;
        self.device.queue.write_buffer(self.resources.steps(), at, bytemuck::bytes_of(step));
    }

    pub(super) fn set_sort_pass(&mut self, slot: u32, pass: &SortPass) {
        let at = u64::from(slot) * UNIFORM_STRIDE;
        self.device.queue.write_buffer(self.resources.sort_passes(), at, bytemuck::bytes_of(pass));
    }

    pub(super) fn set_groups(&mut self, groups: Groups, x: u32, y: u32) {
        let args = DispatchArgs { x, y, z: 1 };
        let at = super::encode::args_offset(groups);
        self.device.queue.write_buffer(self.resources.buffer(Buf::Args), at, bytemuck::bytes_of(&args));
    }

    pub(super) fn run(&mut self, dispatches: &[Dispatch]) {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        encode(&self.device, &mut encoder, &mut self.resources, &self.pipelines, dispatches, None);
        self.device.queue.submit([encoder.finish()]);
        self.device.check().unwrap();
    }

    /// Reads the first `count` elements of a buffer.
    pub(super) fn read<T: bytemuck::Pod>(&self, name: Buf, count: usize) -> Vec<T> {
        self.device.read(self.resources.buffer(name), count).unwrap()
    }
}
