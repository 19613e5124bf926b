//! Buffers by name, and the kernels' bind groups. Replacing a buffer drops all bind groups, which are recreated
//! when next used.

use super::device::{GpuDevice, Pipeline};
use super::kernels::{Buf, KernelId, SORT_PASS_BINDING};
use super::layout::{SortPass, StepUniform};
use std::collections::BTreeMap;

/// Byte offsets of the uniforms of a dispatch.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UniformOffsets {
    /// Offset in the ring of step uniforms.
    pub step: u32,
    /// Offset in the table of sort passes.
    pub sort_pass: u32,
}

pub(super) struct Resources {
    buffers: BTreeMap<Buf, wgpu::Buffer>,
    steps: wgpu::Buffer,
    sort_passes: wgpu::Buffer,
    groups: BTreeMap<(KernelId, bool), wgpu::BindGroup>,
}

impl Resources {
    /// Only the uniforms; the other buffers are set later.
    pub(super) fn new(steps: wgpu::Buffer, sort_passes: wgpu::Buffer) -> Self {
        Self { buffers: BTreeMap::new(), steps, sort_passes, groups: BTreeMap::new() }
    }

    pub(super) fn steps(&self) -> &wgpu::Buffer {
        &self.steps
    }

    pub(super) fn sort_passes(&self) -> &wgpu::Buffer {
        &self.sort_passes
    }

    /// Sets a buffer; an earlier one is freed once the device no longer uses it.
    pub(super) fn set(&mut self, name: Buf, buffer: wgpu::Buffer) {
        if self.buffers.get(&name) != Some(&buffer) {
            self.groups.clear();
            self.buffers.insert(name, buffer);
        }
    }

    /// Drops all bind groups, after pipelines were recompiled.
    pub(super) fn forget_groups(&mut self) {
        self.groups.clear();
    }

    /// Frees a buffer.
    pub(super) fn remove(&mut self, name: Buf) {
        self.groups.clear();
        self.buffers.remove(&name);
    }

    /// A buffer that has been set.
    ///
    /// # Panics
    /// If it has not been set, which is a bug in this backend.
    pub(super) fn buffer(&self, name: Buf) -> &wgpu::Buffer {
        self.buffers.get(&name).unwrap_or_else(|| panic!("buffer {name:?} has not been set"))
    }

    pub(super) fn has(&self, name: Buf) -> bool {
        self.buffers.contains_key(&name)
    }

    /// The bind group of a kernel; `swapped` exchanges input and output of the sort.
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
