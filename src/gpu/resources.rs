//! Buffers by name, and the bind groups of kernels over them. Growing a buffer drops the bind groups; they
//! are made anew when they are next used.

use super::device::{GpuDevice, Pipeline};
use super::kernels::{Buf, KernelId, SORT_PASS_BINDING};
use super::layout::{SortPass, StepUniform};
use std::collections::BTreeMap;

/// Where the host's uniforms of a dispatch start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UniformOffsets {
    /// In the ring of steps, bytes.
    pub step: u32,
    /// In the table of sort passes, bytes.
    pub sort_pass: u32,
}

/// Buffers and bind groups.
pub(super) struct Resources {
    buffers: BTreeMap<Buf, wgpu::Buffer>,
    steps: wgpu::Buffer,
    sort_passes: wgpu::Buffer,
    groups: BTreeMap<(KernelId, bool), wgpu::BindGroup>,
}

impl Resources {
    /// With the uniforms that every kernel binds, and no other buffer yet.
    pub(super) fn new(steps: wgpu::Buffer, sort_passes: wgpu::Buffer) -> Self {
        Self { buffers: BTreeMap::new(), steps, sort_passes, groups: BTreeMap::new() }
    }

    /// The ring of step uniforms.
    pub(super) fn steps(&self) -> &wgpu::Buffer {
        &self.steps
    }

    /// The table of sort passes.
    pub(super) fn sort_passes(&self) -> &wgpu::Buffer {
        &self.sort_passes
    }

    /// Puts a buffer in place; the one before goes once the device is done with it.
    pub(super) fn set(&mut self, name: Buf, buffer: wgpu::Buffer) {
        if self.buffers.get(&name) != Some(&buffer) {
            self.groups.clear();
            self.buffers.insert(name, buffer);
        }
    }

    /// For pipelines that have been made anew.
    pub(super) fn forget_groups(&mut self) {
        self.groups.clear();
    }

    /// Gives a buffer back.
    pub(super) fn remove(&mut self, name: Buf) {
        self.groups.clear();
        self.buffers.remove(&name);
    }

    /// A buffer that must have been put in place.
    ///
    /// # Panics
    /// If it has not: the order of calls in this module is wrong.
    pub(super) fn buffer(&self, name: Buf) -> &wgpu::Buffer {
        self.buffers.get(&name).unwrap_or_else(|| panic!("{name:?} has not been made"))
    }

    /// Whether a buffer has been put in place.
    pub(super) fn has(&self, name: Buf) -> bool {
        self.buffers.contains_key(&name)
    }

    /// The bind group of a kernel; with `swapped`, the sort's halves change places.
    pub(super) fn group(
        &mut self,
        device: &GpuDevice,
        id: KernelId,
        pipeline: &Pipeline,
        swapped: bool,
    ) -> &wgpu::BindGroup {
        if !self.groups.contains_key(&(id, swapped)) {
            let group = self.make_group(device, id, pipeline, swapped);
            self.groups.insert((id, swapped), group);
        }
        &self.groups[&(id, swapped)]
    }

    fn make_group(
        &self,
        device: &GpuDevice,
        id: KernelId,
        pipeline: &Pipeline,
        swapped: bool,
    ) -> wgpu::BindGroup {
        let kernel = id.kernel();
        let uniform = |binding: u32, buffer, bytes: usize| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: wgpu::BufferSize::new(bytes as u64),
            }),
        };
        let mut entries = vec![uniform(0, &self.steps, size_of::<StepUniform>())];
        for (binding, bound) in (1..).zip(kernel.bindings) {
            let name = if swapped { bound.buffer.swapped() } else { bound.buffer };
            entries.push(wgpu::BindGroupEntry { binding, resource: self.buffer(name).as_entire_binding() });
        }
        if kernel.has_sort_pass() {
            entries.push(uniform(SORT_PASS_BINDING, &self.sort_passes, size_of::<SortPass>()));
        }
        device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.name),
            layout: &pipeline.layout,
            entries: &entries,
        })
    }
}
